#include "photogrammetry/photo_masks.h"

#include <map>

#include "base/child_process.h"
#include "base/image_io.h"
#include "base/random.h"
#include "photogrammetry/photo_matches.h"
#include "photogrammetry/testing/fake_colmap.h"

namespace tessera {
namespace {

class PhotoMasksOf : public testing::Test {
 protected:
  PhotoMasksOf() {
    list_.bodies = {{"drone", 16, 12, 0}};
    for (const char* name : {"a/one.jpg", "a/two.jpg", "b/three.jpg"})
      list_.photos.push_back({name, "safe" + std::to_string(list_.photos.size()) + ".jpg", folder_ / name, 0, 0, {}});
    for (const ListedPhoto& photo : list_.photos) writeFileAtomically(photo.file, std::string_view("a picture"));
  }
  // Black on the left.
  void writeMask(const std::string& name, int width = 16, int height = 12, int channels = 1) {
    ImageU8 mask(width, height, channels, 255);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width / 2; ++x) std::fill_n(mask.at(x, y), channels, uint8_t{0});
    fs::path(name).extension() == ".jpg" ? writeJpeg(masks_ / name, mask) : writePng(masks_ / name, mask);
  }
  std::string failure() {
    return errorMessage([this] { PhotoMasks(masks_).addTo(list_); });
  }
  static bool contains(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }

  TemporaryFolder folder_;
  fs::path masks_ = folder_ / "masks";
  PhotoList list_;
};

TEST_F(PhotoMasksOf, AListHaveTheNamesOfItsPhotos) {
  writeMask("a/one.jpg.png");
  writeMask("a/two.jpg", 16, 12, 3);
  PhotoMasks(masks_).addTo(list_);
  EXPECT_EQ(list_.photos[0].mask, masks_ / "a/one.jpg.png");
  EXPECT_EQ(list_.photos[1].mask, masks_ / "a/two.jpg");
  EXPECT_TRUE(list_.photos[2].mask.empty());
  writeMask("b/three.png");
  PhotoMasks(masks_).addTo(list_);
  EXPECT_EQ(list_.photos[2].mask, masks_ / "b/three.png");
}

TEST_F(PhotoMasksOf, AListAreDescribedByTheirContents) {
  writeMask("a/one.png");
  const std::string before = PhotoMasks(masks_).describe();
  writeFileAtomically(masks_ / "a/Thumbs.db", "of another program");
  fs::last_write_time(masks_ / "a/one.png", fs::file_time_type());
  EXPECT_EQ(PhotoMasks(masks_).describe(), before);
  writeMask("b/three.png");
  EXPECT_NE(PhotoMasks(masks_).describe(), before);
  fs::remove(masks_ / "b/three.png");
  writePng(masks_ / "a/one.png", ImageU8(16, 12, 1, 7));
  EXPECT_NE(PhotoMasks(masks_).describe(), before);
}

// As in folders of links into a data set.
TEST_F(PhotoMasksOf, AListMayBeLinks) {
  writePng(folder_ / "elsewhere/mask.png", ImageU8(16, 12, 1, 255));
  fs::create_directories(masks_ / "a");
  fs::create_symlink(folder_ / "elsewhere/mask.png", masks_ / "a/one.png");
  PhotoMasks(masks_).addTo(list_);
  EXPECT_EQ(list_.photos[0].mask, masks_ / "a/one.png");
  list_.photos[1].name = "../elsewhere/mask.jpg";
  PhotoMasks(masks_).addTo(list_);
  EXPECT_TRUE(list_.photos[1].mask.empty());
  fs::create_directory_symlink(folder_ / "elsewhere", masks_ / "b");
  fs::create_directory_symlink(masks_, masks_ / "circle");
  const std::string before = PhotoMasks(masks_).describe();
  writePng(folder_ / "elsewhere/mask.png", ImageU8(16, 12, 1, 7));
  EXPECT_NE(PhotoMasks(masks_).describe(), before);
  const std::string between = PhotoMasks(masks_).describe();
  writePng(folder_ / "elsewhere/three.png", ImageU8(16, 12, 1, 255));
  EXPECT_NE(PhotoMasks(masks_).describe(), between);
}

TEST_F(PhotoMasksOf, AListAreWrittenUntilTheWatchEndsIt) {
  writeMask("a/one.png");
  PhotoMasks(masks_).addTo(list_);
  ThreadPool pool(2);
  EXPECT_THROW(writeMasks(list_, folder_ / "poses/masks", pool, [] { throw std::runtime_error("interrupted"); }),
               std::runtime_error);
  EXPECT_FALSE(fs::exists(folder_ / "poses/masks/safe0.jpg.png"));
}

TEST_F(PhotoMasksOf, AListAreRefusedIfTheyDoNotFit) {
  EXPECT_TRUE(contains(failure(), "masks: is not a folder"));
  writeMask("other.png");
  EXPECT_TRUE(
      contains(failure(), "has no mask of any photo: for a/one.jpg, neither a/one.jpg.png nor a/one.jpg nor a/one.png"))
      << failure();
  writeMask("a/two.png", 12, 16);
  EXPECT_TRUE(contains(failure(), "a/two.png: is 12 x 16 pixels large, and its photo a/two.jpg is 16 x 12"))
      << failure();
  writeFileAtomically(masks_ / "a/two.png", "no picture");
  EXPECT_TRUE(contains(failure(), "a/two.png: cannot be read")) << failure();
}

TEST_F(PhotoMasksOf, AListAreNotThePhotosThemselves) {
  writeJpeg(folder_ / "a/one.jpg", ImageU8(16, 12, 3));
  masks_ = folder_.path();
  EXPECT_TRUE(contains(failure(), "has no mask of any photo"));
}

TEST_F(PhotoMasksOf, ASourceReplaceItsOwn) {
  SourceCapture source;
  for (const char* name : {"images/one.jpg", "images/two.jpg", "images/three.jpg"}) {
    writeJpeg(folder_ / name, ImageU8(16, 12, 3));
    source.capture.photos.emplace_back();
    source.capture.photos.back().name = name;
    source.capture.photos.back().image = folder_ / name;
    source.capture.photos.back().mask = "of the source";
  }
  source.maskIsInverted.assign(3, true);
  writeMask("images/one.png");
  writeMask("two.png");
  PhotoMasks(masks_).addTo(source);
  EXPECT_EQ(source.capture.photos[0].mask, masks_ / "images/one.png");
  EXPECT_EQ(source.capture.photos[1].mask, masks_ / "two.png");
  EXPECT_EQ(source.capture.photos[2].mask, "of the source");
  EXPECT_EQ(source.maskIsInverted, (std::vector<bool>{false, false, true}));
  writeMask("three.png", 3, 3);
  EXPECT_TRUE(contains(errorMessage([&] { PhotoMasks(masks_).addTo(source); }), "three.png: is 3 x 3 pixels large"));
}

TEST_F(PhotoMasksOf, AListReachFeatures) {
  writeMask("a/one.png", 16, 12, 3);
  PhotoMasks(masks_).addTo(list_);
  makeDatabase(folder_ / "made.db");
  const std::string script = "case $command in database_creator) cp " + (folder_ / "made.db").string() +
                             " $database_path;; feature_extractor) echo $ImageReader_mask_path;; esac";
  const fs::path program = writeColmap(folder_, script);
  PhotoMatches matches(folder_ / "poses", list_, {.program = program});
  matches.extractFeatures([](int64_t) {});
  EXPECT_TRUE(contains(readTextFile(folder_ / "poses/features.log"), (folder_ / "poses/masks").string()));
  const ImageU8 mask = readImage(folder_ / "poses/masks/safe0.jpg.png").image;
  EXPECT_EQ(mask.channels, 1);
  EXPECT_EQ(mask.at(0, 0)[0], 0);
  EXPECT_EQ(mask.at(15, 11)[0], 255);
  EXPECT_FALSE(fs::exists(folder_ / "poses/masks/safe1.jpg.png"));
  matches.discard();
  EXPECT_FALSE(fs::exists(folder_ / "poses/masks"));
}

TEST_F(PhotoMasksOf, AListAreRefusedIfTheyExcludeEverything) {
  for (const char* name : {"a/one.png", "a/two.png", "b/three.png"}) writePng(masks_ / name, ImageU8(16, 12, 1, 1));
  PhotoMasks(masks_).addTo(list_);
  ThreadPool pool(2);
  const auto write = [&] { return errorMessage([&] { writeMasks(list_, folder_ / "poses/masks", pool); }); };
  EXPECT_TRUE(contains(write(), "--masks: excludes all pixels of all photos")) << write();
  EXPECT_TRUE(contains(write(), "--masks: excludes all pixels of all photos")) << "masks that have been written";
  writeMask("b/three.png");
  fs::remove_all(folder_ / "poses/masks");
  EXPECT_EQ(write(), "");
}

// Of the installed program: no feature lies where a mask is black.
TEST_F(PhotoMasksOf, AListKeepColmapFromFeatures) {
  ChildProcess process;
  if (!process.start({"colmap", "help"}).empty()) GTEST_SKIP() << "colmap is not installed";
  process.wait();
  list_.bodies[0].width = 320;
  list_.bodies[0].height = 240;
  ImageU8 picture(320, 240, 1);
  const RandomStream random(1, 1);
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x)
      picture.at(x, y)[0] = static_cast<uint8_t>(255 * random.uniformDouble(static_cast<uint64_t>(y / 6 * 64 + x / 6)));
  for (const ListedPhoto& photo : list_.photos) writePng(photo.file, picture);
  writeMask("a/one.jpg.png", 320, 240);
  PhotoMasks(masks_).addTo(list_);
  PhotoMatches matches(folder_ / "poses", list_, {.threads = 1});
  matches.extractFeatures([](int64_t) {});

  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open((folder_ / "poses/database.db").c_str(), &handle), SQLITE_OK);
  sqlite3_stmt* statement = nullptr;
  ASSERT_EQ(sqlite3_prepare_v2(handle, "SELECT image_id, rows, cols, data FROM keypoints", -1, &statement, nullptr),
            SQLITE_OK);
  std::map<int, std::pair<int, int>> counts;  // of features on the left and on the right, by photo
  while (sqlite3_step(statement) == SQLITE_ROW) {
    const auto* values = static_cast<const float*>(sqlite3_column_blob(statement, 3));
    for (int i = 0; i < sqlite3_column_int(statement, 1); ++i) {
      auto& [left, right] = counts[sqlite3_column_int(statement, 0)];
      ++(values[i * sqlite3_column_int(statement, 2)] < 160 ? left : right);
    }
  }
  sqlite3_finalize(statement);
  sqlite3_close(handle);
  EXPECT_EQ(counts[1].first, 0);
  EXPECT_GT(counts[1].second, 20);
  EXPECT_GT(counts[2].first, 20) << "it has no mask";
}

}  // namespace
}  // namespace tessera
