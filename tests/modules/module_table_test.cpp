// Tests the table of modules in ARCHITECTURE.md: no file includes what its module may not use, and libraries link only
// what the table allows. For files that only tests need, the rule is wider: they may also include what their binary
// links, and test helpers, which are in a module's testing/ folder and which only tests may include.
#include "modules/module_table.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <sstream>

#include "base/error.h"
#include "base/file.h"
#include "modules/cmake_targets.h"
#include "tests/project.h"

namespace tessera {
namespace {

struct Include {
  int line = 0;
  std::string header;  // as written; if it begins with "..", relative to the project's root
};

// The includes of all C++ files in src/ and apps/, by their paths as in includes. Headers in angle brackets, and those
// in shaders/, which the build generates or GLSL shares, belong to no module.
class Sources {
 public:
  Sources() {
    for (const char* root : {"src", "apps"}) {
      for (const fs::directory_entry& entry : fs::recursive_directory_iterator(kProject / root)) {
        const std::string extension = entry.path().extension().string();
        if (extension != ".cpp" && extension != ".h") continue;
        const std::string file = includeName(entry.path());
        includes_[file] = readIncludes(entry.path());
      }
    }
    for (const auto& [file, includes] : includes_) {
      if (file.ends_with(".cpp") && !isTest(file)) reach(file, production_);
    }
  }

  static std::string includeName(const fs::path& path) {
    const std::string name = path.lexically_relative(kProject).generic_string();
    return name.starts_with("src/") ? name.substr(4) : name;
  }
  static bool isTest(const std::string& file) {
    return file.find("_test.") != std::string::npos || file.find("_test_") != std::string::npos || isFuzzer(file) ||
           isTestHelper(file);
  }
  static bool isTestHelper(const std::string& file) { return file.find("/testing/") != std::string::npos; }
  static bool isFuzzer(const std::string& file) { return file.find("_fuzz.") != std::string::npos; }

  const std::map<std::string, std::vector<Include>>& includes() const { return includes_; }
  // Sources that are not tests, and everything that they include. A header that only tests include is a test helper.
  const std::set<std::string>& production() const { return production_; }
  // Returns a file and what it includes, directly or indirectly, without what production sources include.
  std::set<std::string> ofTest(const std::string& file) const {
    std::set<std::string> files = production_;
    std::set<std::string> own;
    reach(file, files);
    std::set_difference(files.begin(), files.end(), production_.begin(), production_.end(),
                        std::inserter(own, own.end()));
    return own;
  }

 private:
  static std::vector<Include> readIncludes(const fs::path& path) {
    std::vector<Include> includes;
    std::istringstream in(readTextFile(path));
    int number = 0;
    for (std::string line; std::getline(in, line);) {
      ++number;
      constexpr std::string_view kInclude = "#include \"";
      if (!line.starts_with(kInclude)) continue;
      std::string header = line.substr(kInclude.size(), line.find('"', kInclude.size()) - kInclude.size());
      if (header.starts_with("shaders/")) continue;
      if (header.starts_with(".")) header = includeName((path.parent_path() / header).lexically_normal());
      includes.push_back({number, header});
    }
    return includes;
  }
  void reach(const std::string& file, std::set<std::string>& files) const {
    std::vector<std::string> open = {file};
    while (!open.empty()) {
      const std::string next = open.back();
      open.pop_back();
      const auto it = includes_.find(next);
      if (it == includes_.end() || !files.insert(next).second) continue;
      for (const Include& include : it->second) open.push_back(include.header);
    }
  }

  std::map<std::string, std::vector<Include>> includes_;
  std::set<std::string> production_;
};

ModuleTable tableOfProject() {
  return ModuleTable::parse(readTextFile(kProject / "ARCHITECTURE.md"));
}

CmakeTargets targetsOfProject() {
  CmakeTargets targets;
  for (const char* root : {"src", "apps"}) {
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(kProject / root)) {
      if (entry.path().filename() != "CMakeLists.txt") continue;
      addCmakeTargets(Sources::includeName(entry.path().parent_path()), readTextFile(entry.path()), targets);
    }
  }
  return targets;
}

std::string sourcePath(const std::string& name) {
  return name.starts_with("apps/") ? name : "src/" + name;
}

std::string describeInclude(const std::string& file, const Include& include) {
  return fmt::format("{}:{}: includes \"{}\"", sourcePath(file), include.line, include.header);
}

// Returns the modules to which a target's sources belong; for a target without sources, the module of its folder.
std::set<std::string> targetModules(const ModuleTable& table, const CmakeTarget& target) {
  std::set<std::string> modules;
  for (const std::string& source : target.sources) modules.insert(table.findModule(source));
  if (modules.empty()) modules.insert(table.findModule(target.folder + "/CMakeLists.txt"));
  return modules;
}

std::set<std::string> modulesLinkedBy(const ModuleTable& table, const CmakeTargets& targets, const std::string& name) {
  std::set<std::string> modules;
  for (const std::string& link : linkedBy(targets, name)) {
    if (const auto it = targets.find(link); it != targets.end()) modules.merge(targetModules(table, it->second));
  }
  return modules;
}

TEST(Modules, IncludeOnlyWhatTheTableAllows) {
  const ModuleTable table = tableOfProject();
  const Sources sources;
  EXPECT_GT(sources.production().size(), 300u);
  for (const std::string& file : sources.production()) {
    EXPECT_FALSE(Sources::isTestHelper(file)) << sourcePath(file) << " is for tests, and other code includes it";
    for (const Include& include : sources.includes().at(file)) {
      const std::string broken = table.validationError(file, include.header);
      EXPECT_EQ(broken, "") << describeInclude(file, include);
      EXPECT_TRUE(sources.includes().contains(include.header))
          << describeInclude(file, include) << ", which is no file";
    }
  }
}

TEST(Modules, HaveTestsThatIncludeOnlyWhatTheTableAllowsOrTheirBinaryLinks) {
  const ModuleTable table = tableOfProject();
  const CmakeTargets targets = targetsOfProject();
  const Sources sources;
  std::map<std::string, std::string> binaries;  // by test file; fuzzers have binaries of their own in tests/fuzz
  for (const auto& [name, target] : targets) {
    for (const std::string& source : target.sources) {
      if (target.isTest) binaries[source] = name;
    }
  }
  size_t checked = 0;
  for (const auto& [source, unused] : sources.includes()) {
    if (!source.ends_with(".cpp") || !Sources::isTest(source)) continue;
    const std::string binary = binaries[source];
    EXPECT_EQ(binary.empty(), Sources::isFuzzer(source)) << "src/" << source << " is in no test binary";
    const std::set<std::string> linked = modulesLinkedBy(table, targets, binary);
    for (const std::string& file : sources.ofTest(source)) {
      for (const Include& include : sources.includes().at(file)) {
        if (!sources.includes().contains(include.header)) continue;  // headers in tests/
        if (Sources::isTestHelper(include.header)) continue;         // its own includes are checked instead
        const std::string broken = table.validationError(file, include.header);
        EXPECT_TRUE(broken.empty() || linked.contains(table.findModule(include.header)))
            << describeInclude(file, include) << ": " << broken << ", nor does tessera_" << binary << " link it";
        ++checked;
      }
    }
  }
  EXPECT_GT(checked, 300u);
}

TEST(Modules, LinkInCmakeWhatTheTableAllows) {
  const ModuleTable table = tableOfProject();
  const CmakeTargets targets = targetsOfProject();
  size_t checked = 0;
  for (const auto& [name, target] : targets) {
    if (target.isTest || target.sources.empty()) continue;
    std::set<std::string> allowed = targetModules(table, target);
    const std::set<std::string> own = allowed;
    for (const std::string& source : target.sources) {
      const std::vector<std::string> uses = table.allowedIncludes(source);
      allowed.insert(uses.begin(), uses.end());
    }
    const std::string place = sourcePath(target.folder) + "/CMakeLists.txt: " + name;
    // A target may link a module if some of the module's headers are allowed, or if everything outside apps/ is.
    const auto isAllowed = [&](const std::string& module) {
      if (allowed.contains("all") && !module.starts_with("apps/")) return true;
      return std::any_of(allowed.begin(), allowed.end(), [&](const std::string& one) {
        return one == module || (one.ends_with(".h") && table.findModule(one) == module);
      });
    };
    for (const std::string& link : target.links) {
      const auto linked = targets.find(link);
      ASSERT_NE(linked, targets.end()) << place << " links " << link << ", which is nothing of the project";
      for (const std::string& module : targetModules(table, linked->second)) {
        EXPECT_TRUE(isAllowed(module)) << place << " links " << link << ", but " << *own.begin() << " may not use "
                                       << module;
        ++checked;
      }
    }
    const std::set<std::string> linked = modulesLinkedBy(table, targets, name);
    for (const std::string& module : allowed) {
      if (module == "all" || module.ends_with(".h") || own.contains(module)) continue;
      EXPECT_TRUE(linked.contains(module)) << place << " does not link " << module << ", which the table says it uses";
    }
  }
  EXPECT_GT(checked, 30u);
}

TEST(Modules, LinkNoTrainerIntoLibrariesThatOnlyDrawScenes) {
  const CmakeTargets targets = targetsOfProject();
  for (const std::string scenes : {"scene_source", "cpu_drawers", "gpu_drawers"}) {
    const std::set<std::string> linked = linkedBy(targets, scenes);
    EXPECT_TRUE(linked.contains("codecs")) << scenes;
    for (const std::string& link : linked) {
      EXPECT_TRUE(link != "train" && !link.ends_with("_train") && link != "methods") << scenes << " links " << link;
    }
  }
  EXPECT_TRUE(linkedBy(targets, "model_source").contains("train"));
}

constexpr const char* kTable = R"(# Architecture

## Modules, bottom to top

| module | may use | what it is |
|---|---|---|
| `base` | — | files |
| `compute` | base; `vulkan/` and `make_device.cpp` also gpu | devices |
| `gpu` | base | Vulkan |
| `representations` | base | the list |
| `representations/<name>/content`, `representations/<name>/bake` | base | in memory |
| `representations/<name>/cpu` | base, `representations/<name>/content` | drawing |
| `representations/mesh/cpu` | base, gpu | drawing otherwise |
| `apps/tessera` | all | the program |
| `apps/viewer` | all, `apps/tessera/render_source.h` | the window |

| not | of this | table |
|---|---|---|
| `other` | base | |
)";

TEST(ModuleTable, RefusesWhatNoRowAllowsAndSaysWhy) {
  const ModuleTable table = ModuleTable::parse(kTable);
  EXPECT_EQ(table.validationError("compute/device.cpp", "base/check.h"), "");
  EXPECT_EQ(table.validationError("compute/device.cpp", "compute/vulkan/device.h"), "");
  EXPECT_EQ(table.validationError("base/file.cpp", "compute/device.h"), "base may use nothing, not compute");
  EXPECT_EQ(table.validationError("gpu/heap.cpp", "compute/device.h"), "gpu may use base, not compute");
  EXPECT_EQ(table.validationError("other/a.cpp", "base/file.h"), "other/a.cpp belongs to no module");
  EXPECT_EQ(table.validationError("gpu/heap.cpp", "other/a.h"), "other/a.h belongs to no module");
}

TEST(ModuleTable, WidensARowForTheFilesThatItNames) {
  const ModuleTable table = ModuleTable::parse(kTable);
  EXPECT_EQ(table.validationError("compute/vulkan/adam.cpp", "gpu/heap.h"), "");
  EXPECT_EQ(table.validationError("compute/make_device.cpp", "gpu/heap.h"), "");
  EXPECT_EQ(table.validationError("compute/device.cpp", "gpu/heap.h"), "compute may use base, not gpu");
}

TEST(ModuleTable, TakesTheLongestRowThatHoldsAFile) {
  const ModuleTable table = ModuleTable::parse(kTable);
  EXPECT_EQ(table.findModule("representations/list.h"), "representations");
  EXPECT_EQ(table.findModule("representations/hash/notes.h"), "representations");
  EXPECT_EQ(table.findModule("representations/hash/content/a.h"), "representations/hash/content");
  EXPECT_EQ(table.findModule("representations/hash/bake/a.h"), "representations/hash/bake");
  EXPECT_EQ(table.validationError("representations/mesh/cpu/a.h", "gpu/heap.h"), "");
  EXPECT_EQ(table.validationError("representations/hash/cpu/a.h", "gpu/heap.h"),
            "representations/hash/cpu may use base, representations/hash/content, not gpu");
}

TEST(ModuleTable, KeepsOneRepresentationFromAnother) {
  const ModuleTable table = ModuleTable::parse(kTable);
  EXPECT_EQ(table.validationError("representations/hash/cpu/a.h", "representations/hash/content/b.h"), "");
  EXPECT_EQ(table.validationError("representations/hash/cpu/a.h", "representations/volume/content/b.h"),
            "representations/hash/cpu may use base, representations/hash/content, not representations/volume/content");
}

TEST(ModuleTable, AllowsOnlyTheNamedFilesOfOtherApplications) {
  const ModuleTable table = ModuleTable::parse(kTable);
  EXPECT_EQ(table.validationError("apps/viewer/main.cpp", "representations/hash/cpu/a.h"), "");
  EXPECT_EQ(table.validationError("apps/viewer/main.cpp", "apps/tessera/render_source.h"), "");
  EXPECT_EQ(table.validationError("apps/viewer/main.cpp", "apps/tessera/verbs.h"),
            "apps/viewer may use all, apps/tessera/render_source.h, not apps/tessera");
}

TEST(ModuleTable, RejectsUnknownModulesDuplicateRowsAndMissingTables) {
  EXPECT_THROW(ModuleTable::parse("## bottom to top\n| a | b |\n|---|---|\n| `base` | gone |\n"), Error);
  EXPECT_THROW(ModuleTable::parse("## bottom to top\n| a | b |\n|---|---|\n| `a` | — |\n| `a` | — |\n"), Error);
  EXPECT_THROW(ModuleTable::parse("## elsewhere\n| a | b |\n|---|---|\n| `base` | — |\n"), Error);
}

TEST(CmakeTargets, AreThoseOfModulesAndRepresentations) {
  CmakeTargets targets;
  addCmakeTargets("render", R"(tessera_module(render  # the oracle
    SOURCES a.cpp cpu/b.cpp
    USES tiles
    TESTS a_test.cpp)
  if(TESSERA_TESTS)
    target_link_libraries(tessera_render_test PRIVATE tessera_import PkgConfig::HWY)
  endif())",
                  targets);
  addCmakeTargets("representations/hash", R"(tessera_representation(hash
    CONTENT content/a.cpp CONTENT_USES tiles
    CPU cpu/b.cpp CPU_USES render
    TESTS cpu/b_test.cpp TEST_USES import))",
                  targets);
  EXPECT_EQ(targets["render"].sources, (std::vector<std::string>{"render/a.cpp", "render/cpu/b.cpp"}));
  EXPECT_EQ(targets["render"].links, std::set<std::string>{"tiles"});
  EXPECT_EQ(targets["render_test"].links, (std::set<std::string>{"import", "render"}));
  EXPECT_EQ(targets["hash_content"].links, std::set<std::string>{"tiles"});
  EXPECT_EQ(targets["hash_cpu"].links, (std::set<std::string>{"hash_content", "render"}));
  EXPECT_EQ(targets["representation_hash_test"].sources,
            std::vector<std::string>{"representations/hash/cpu/b_test.cpp"});
  EXPECT_EQ(linkedBy(targets, "representation_hash_test"),
            (std::set<std::string>{"hash_content", "hash_cpu", "import", "render", "tiles"}));
}

}  // namespace
}  // namespace tessera
