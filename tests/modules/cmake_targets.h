// Reads the libraries and tests that the project's CMakeLists.txt files declare, in as much detail as needed to check
// them against the module table.
#pragma once

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

struct CmakeTarget {
  std::string folder;                // of its CMakeLists.txt, spelt as in includes: "compute/cpu", "apps/tessera"
  std::vector<std::string> sources;  // spelt as in includes: "compute/cpu/adam.cpp"
  std::set<std::string> links;       // names of other targets of the project
  bool isTest = false;
};

// By name, without "tessera_"; a module's tests are "<module>_test". Conditions in the CMakeLists.txt are assumed to
// hold.
using CmakeTargets = std::map<std::string, CmakeTarget>;

// Reads tessera_module, tessera_representation, add_library, add_executable and target_link_libraries.
void addCmakeTargets(const std::string& folder, std::string_view listFile, CmakeTargets& targets);

// Returns the targets that a target links, directly or transitively.
std::set<std::string> linkedBy(const CmakeTargets& targets, const std::string& name);

}  // namespace tessera
