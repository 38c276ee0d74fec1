#include "export/glb_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>

#include "base/error.h"
#include "tiles/glb.h"

namespace tessera {
namespace {

class GlbFileTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("tessera-glb-file-" + std::to_string(::getpid()));
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& entry : fs::directory_iterator(root_)) all.push_back(entry.path().filename().string());
    return all;
  }

  fs::path root_;
};

Bytes makeBytes(std::initializer_list<int> values) {
  Bytes bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

TEST_F(GlbFileTest, ReplacesWhatALinkLeadsTo) {
  writeFileAtomically(root_ / "large disk/old.glb", std::string_view("old"));
  fs::create_symlink(root_ / "large disk/old.glb", root_ / "a.glb");
  GlbFile file(root_ / "a.glb");
  file.addView(makeBytes({1, 2, 3, 4}));
  const uint64_t size = file.commit({{"asset", {{"version", "2.0"}}}});
  EXPECT_TRUE(fs::is_symlink(root_ / "a.glb"));
  EXPECT_EQ(fs::file_size(root_ / "large disk/old.glb"), size);
}

TEST_F(GlbFileTest, HoldsEachViewAtAMultipleOfFourBytes) {
  GlbFile file(root_ / "a.glb");
  const Bytes first = makeBytes({1, 2, 3, 4, 5}), second = makeBytes({6, 7});
  EXPECT_EQ(file.addView(first), 0u);
  EXPECT_EQ(file.addView(second, kGltfIndices), 1u);
  const uint64_t size = file.commit({{"asset", {{"version", "2.0"}}}});
  const Bytes bytes = readFile(root_ / "a.glb");
  EXPECT_EQ(bytes.size(), size);
  const auto glb = decodeGlb(bytes);
  ASSERT_TRUE(glb);
  const auto asset = nlohmann::json::parse(glb->json);
  EXPECT_EQ(asset["asset"]["version"], "2.0");
  EXPECT_EQ(asset["buffers"][0]["byteLength"], 12);
  ASSERT_EQ(asset["bufferViews"].size(), 2u);
  EXPECT_EQ(asset["bufferViews"][1]["target"], kGltfIndices);
  EXPECT_FALSE(asset["bufferViews"][0].contains("target"));
  const std::pair<const Bytes*, size_t> views[] = {{&first, 0}, {&second, 1}};
  for (const auto& [expected, number] : views) {
    const auto& view = asset["bufferViews"][number];
    ASSERT_EQ(view["byteLength"], expected->size());
    const size_t offset = view["byteOffset"].get<size_t>();
    EXPECT_EQ(offset % 4, 0u);
    EXPECT_EQ(std::memcmp(glb->bytes.data() + offset, expected->data(), expected->size()), 0);
  }
  EXPECT_EQ(names(), std::vector<std::string>{"a.glb"});
}

TEST_F(GlbFileTest, LeavesNothingAndAnOlderFileAsItWasWithoutCommit) {
  writeFileAtomically(root_ / "a.glb", "older");
  {
    GlbFile file(root_ / "a.glb");
    file.addView(makeBytes({1}));
  }
  EXPECT_EQ(names(), std::vector<std::string>{"a.glb"});
  EXPECT_EQ(readTextFile(root_ / "a.glb"), "older");
}

TEST_F(GlbFileTest, RefusesAFolder) {
  EXPECT_THROW(GlbFile{root_}, Error);
}

}  // namespace
}  // namespace tessera
