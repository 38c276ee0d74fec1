// What the CMakeLists.txt of the project say of its libraries and tests: enough to hold them against the module table.
#pragma once

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

struct CmakeTarget {
  std::string folder;                // of its CMakeLists.txt, as in includes: "compute/cpu", "apps/tessera"
  std::vector<std::string> sources;  // likewise: "compute/cpu/adam.cpp"
  std::set<std::string> links;       // names of other targets of the project
  bool isTest = false;
};

// By name, without "tessera_"; a module's tests are "<module>_test". Conditions are taken to hold.
using CmakeTargets = std::map<std::string, CmakeTarget>;

// Reads tessera_module, tessera_representation, add_library, add_executable and target_link_libraries.
void addCmakeTargets(const std::string& folder, std::string_view listFile, CmakeTargets& targets);

// The targets that it links, and those that they link, and so on.
std::set<std::string> linkedBy(const CmakeTargets& targets, const std::string& name);

}  // namespace tessera
