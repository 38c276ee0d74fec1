#include "pipeline/result_digests.h"

#include <gtest/gtest.h>

#include <set>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(ResultDigests, TellModelsApartByTheirManifestSettingsAndCheckpoints) {
  const TemporaryFolder folder;
  EXPECT_EQ(modelDigest(folder.path()), "");
  const std::pair<const char*, const char*> files[] = {
      {"manifest.json", R"({"files": ["blocks/0/step-20.safetensors"]})"},
      {"config.toml", "width = 16"},
      {"blocks.json", "{}"},
      {"blocks/0/step-20.safetensors", "numbers"},
      {"levels/1/manifest.json", "{}"}};
  for (const auto& [name, text] : files) writeFileAtomically(folder / name, std::string_view(text));
  const std::string digest = modelDigest(folder.path());
  std::set<std::string> digests{digest};
  for (const auto& [name, text] : files) {
    writeFileAtomically(folder / name, std::string(text) + " ");
    digests.insert(modelDigest(folder.path()));
    writeFileAtomically(folder / name, std::string_view(text));
  }
  EXPECT_EQ(digests.size(), 6u);
  EXPECT_EQ(modelDigest(folder.path()), digest);
  for (const char* damaged : {"", "[]", "{\"files\": 1}", "{\"files\": [1]}"}) {
    writeFileAtomically(folder / "manifest.json", std::string_view(damaged));
    EXPECT_NE(modelDigest(folder.path()), digest);
  }
}

TEST(ResultDigests, TellScenesApart) {
  const TemporaryFolder folder;
  EXPECT_EQ(sceneDigest(folder.path()), "");
  writeFileAtomically(folder / "tileset.json", std::string_view("a"));
  const std::string digest = sceneDigest(folder.path());
  writeFileAtomically(folder / "tileset.json", std::string_view("b"));
  EXPECT_NE(sceneDigest(folder.path()), digest);
}

}  // namespace
}  // namespace tessera
