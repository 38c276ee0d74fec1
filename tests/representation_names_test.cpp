// Tests that code outside of a representation does not name any, so that adding one requires only a row in
// representations/list.h.
#include "tests/representation_names.h"

#include <gtest/gtest.h>

#include <map>

#include "base/file.h"
#include "representations/list.h"
#include "tests/project.h"

namespace tessera {
namespace {

bool isSource(const fs::path& path) {
  const std::string kind = path.extension().string(), name = path.filename().string();
  for (const char* test : {"_test.", "_test_", ".test.", "_fuzz.", "test_support"}) {
    if (name.find(test) != std::string::npos) return false;
  }
  for (const char* extension : {".cpp", ".h", ".comp", ".vert", ".frag", ".glsl", ".ts"}) {
    if (kind == extension) return true;
  }
  return false;
}

// Returns whether a folder may name representations, or contains tests.
bool isApart(const std::string& path) {
  if (path.find("/testing/") != std::string::npos) return true;
  for (const char* folder : {"src/representations/", "src/raymarch/", "shaders/representations/", "shaders/raymarch/",
                             "web/src/representations/", "web/src/raymarch/", "web/src/testing/"}) {
    if (path.starts_with(folder)) return true;
  }
  return false;
}

// Returns the representations that each file names, by path relative to the project.
std::map<std::string, std::set<std::string>> namesIn(const std::vector<std::string>& folders) {
  std::map<std::string, std::set<std::string>> names;
  for (const std::string& folder : folders) {
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(kProject / folder)) {
      const std::string path = entry.path().lexically_relative(kProject).generic_string();
      if (!entry.is_regular_file() || !isSource(entry.path()) || isApart(path)) continue;
      const std::string source = readTextFile(entry.path());
      names[path] = NamedRepresentations(source).names();
    }
  }
  return names;
}

using Names = std::set<std::string>;

Names namedBy(std::string_view source) {
  return NamedRepresentations(source).names();
}

TEST(RepresentationNames, AreSeenInCode) {
  EXPECT_EQ(namedBy("VolumeContent decodeHash(x);"), (Names{"volume", "hash"}));
  EXPECT_EQ(namedBy("kDrawVolumeSpirv"), Names{"volume"});
  EXPECT_EQ(namedBy("draw_hash_varying"), Names{"hash"});
  EXPECT_EQ(namedBy("method == \"field\" || kind === 'volume'"), (Names{"field", "volume"}));
  EXPECT_EQ(namedBy("\"train with --method volume\""), Names{"volume"});
  EXPECT_EQ(namedBy("#include \"representations/field/config.h\""), Names{"field"});
  EXPECT_EQ(namedBy("#include \"tiles/hash_payload.h\"\nimport x from './volume-content'"), (Names{"volume", "hash"}));
}

TEST(RepresentationNames, AreNotSeenInOrdinaryWords) {
  EXPECT_EQ(namedBy("// VolumeContent\n/* \"hash\" */"), Names());
  EXPECT_EQ(namedBy("HashGridLevel kHashGridForward hash_grid hashGridIndex(x) latticeHash"), Names());
  EXPECT_EQ(namedBy("#include \"compute/hash_grid.h\"\n#include \"synth/light_volume.h\""), Names());
  EXPECT_EQ(namedBy("LightVolume light; ConfigField field; SurfaceMesh mesh; int hash = 1'000, volume;"), Names());
  EXPECT_EQ(namedBy("\"the volume of a hash\" \"\\\"\" x = '\\'' + y"), Names());
}

TEST(RepresentationNames, CoverTheList) {
#define NAME(name, Name) #name,
  for (const std::string_view name : {TESSERA_REPRESENTATIONS(NAME, NAME)}) {
#undef NAME
    EXPECT_EQ(namedBy("\"" + std::string(name) + "\""), Names{std::string(name)}) << "is not looked for";
  }
}

TEST(RepresentationNames, OccurTogetherInAtMostTwoFiles) {
  constexpr size_t kMax = 2;
  std::string files;
  size_t count = 0;
  for (const auto& [path, names] : namesIn({"apps", "src", "shaders", "web/src", "bench"})) {
    if (names.size() < 2) continue;
    ++count;
    files += "\n  " + path + ":";
    for (const std::string& name : names) files += " " + name;
  }
  std::printf("%zu files name two or more representations:%s\n", count, files.c_str());
  EXPECT_LE(count, kMax) << files;
}

TEST(RepresentationNames, DoNotOccurInProgramsOrSharedModules) {
  const auto files =
      namesIn({"apps", "src/bake", "src/render", "src/tiles", "src/train", "web/src/tiles", "web/src/stream"});
  EXPECT_GT(files.size(), 120u);
  for (const auto& [path, names] : files) {
    if (names.empty()) continue;
    ADD_FAILURE() << path << " names " << *names.begin();
  }
}

}  // namespace
}  // namespace tessera
