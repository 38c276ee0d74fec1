// What imports take from their sources, and what they leave as it is.
#include <gtest/gtest.h>

#include "base/error.h"
#include "import/testing/import_fixture.h"

namespace tessera {
namespace {

TEST_F(Import, ReducesPngsByTheirContentWhateverTheirExtension) {
  for (const char* name : {"images/a.PNG", "images/b.jpg"}) {
    writePng(source_ / name, gradientPicture(3000, 2250, 4));
    frames_.push_back({name, ""});
  }
  write();
  std::string json = readTextFile(source_ / "transforms.json");
  json.replace(json.find("\"w\":16,\"h\":12"), 13, "\"w\":3000,\"h\":2250");
  writeFileAtomically(source_ / "transforms.json", json);
  const Capture capture = run({.downscale = 1});
  EXPECT_EQ(capture.photos.size(), 2u);
  fs::remove_all(out_);
  for (const Photo& photo : run({.downscale = 2}).photos)
    EXPECT_EQ(readImage(photo.image).image.channels, 4) << "beyond the size of lossless pictures";
}

TEST_F(Import, NeverReplacesWhatItHasNotWritten) {
  add("images/a.png");
  write();
  const std::string poses = readTextFile(source_ / "transforms.json");
  EXPECT_THROW(importCapture(source_ / "transforms.json", source_), Error) << "the source itself, by its file";
  writeFileAtomically(out_ / "transforms.json", poses);
  EXPECT_THROW(run(), Error) << "of another scene";
  EXPECT_EQ(readTextFile(out_ / "transforms.json"), poses);
  fs::remove(out_ / "transforms.json");
  writePng(out_ / "images/a.png", gradientPicture(16, 12, 3, 77));
  const Bytes own = readFile(out_ / "images/a.png");
  EXPECT_THROW(run(), Error) << "another photo of that name";
  EXPECT_EQ(readFile(out_ / "images/a.png"), own);
  EXPECT_EQ(readTextFile(source_ / "transforms.json"), poses);
}

TEST_F(Import, FindsPhotosBesideAFileWithoutAFolder) {
  add("images/a.png");
  write();
  const fs::path before = fs::current_path();
  fs::current_path(source_);
  const Capture capture = importCapture("transforms.json", out_);
  fs::current_path(before);
  ASSERT_EQ(capture.photos.size(), 1u);
  EXPECT_EQ(capture.photos[0].name, "images/a.png");
}

TEST_F(Import, DropsDamagedPhotosInPlace) {
  const Bytes whole = encodeJpeg(gradientPicture(160, 120), 95);
  Bytes cut = whole;
  cut.resize(cut.size() / 2);
  writeFileAtomically(source_ / "images/a.jpg", whole);
  writeFileAtomically(source_ / "images/b.jpg", cut);
  const fs::path model = source_ / "sparse/0";
  writeFileAtomically(model / "images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 1 0 0 1 b.jpg\n\n");
  writeFileAtomically(model / "cameras.txt", "1 PINHOLE 160 120 90 90 80 60\n");
  EXPECT_EQ(importCapture(model, source_).photos.size(), 1u);
  EXPECT_EQ(readFile(source_ / "images/b.jpg"), cut) << "it stays";
}

TEST_F(Import, KeepsMasksOfTheSourceInPlace) {
  writePng(source_ / "images/a.png", gradientPicture(16, 12));
  writePng(source_ / "masks/a.png", ImageU8(16, 12, 1, 255));
  const Bytes mask = readFile(source_ / "masks/a.png");
  const fs::path model = source_ / "sparse/0";
  writeFileAtomically(model / "images.txt", "1 1 0 0 0 0 0 0 1 a.png\n\n");
  writeFileAtomically(model / "cameras.txt", "1 PINHOLE 16 12 9 9 8 6\n");
  EXPECT_THROW(importCapture(model, source_, {.maskCommand = "cp {image} {mask}"}), Error);
  EXPECT_EQ(readFile(source_ / "masks/a.png"), mask);
}

// Its Z is an axis of COLMAP's world, which says nothing.
TEST_F(Import, DoesNotTrustTheUpDirectionOfNerfstudiosConverter) {
  for (int i = 0; i < 3; ++i)
    add("images/" + std::to_string(i) + ".png", 16, 12, ",\"colmap_im_id\":" + std::to_string(i));
  write();
  run();
  EXPECT_FALSE(logged("the source's Z is up")) << log_;
}

TEST_F(Import, TakesThePoseAtTheStartOfARollingShutter) {
  add("images/a.png");
  write();
  std::string json = readTextFile(source_ / "transforms.json");
  json.replace(json.find("transform_matrix"), 16, "transform_matrix_start");
  writeFileAtomically(source_ / "transforms.json", json);
  EXPECT_EQ(run().photos.size(), 1u);
  EXPECT_TRUE(logged("exposed at one instant")) << log_;
}

TEST_F(Import, NamesAPhotoWhoseNameIsNotUtf8BeforeItImportsAny) {
  writePng(source_ /
               "images/S\xfc"
               "d.png",
           gradientPicture(16, 12));
  const fs::path model = source_ / "sparse/0";
  writeFileAtomically(model / "images.txt",
                      "1 1 0 0 0 0 0 0 1 S\xfc"
                      "d.png\n\n");
  writeFileAtomically(model / "cameras.txt", "1 PINHOLE 16 12 9 9 8 6\n");
  try {
    run();
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(error.subject().find("d.png"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(fs::exists(out_));
}

}  // namespace
}  // namespace tessera
