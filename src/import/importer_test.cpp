#include "import/importer.h"

#include <gtest/gtest.h>

#include <chrono>

#include "base/error.h"
#include "import/capture_reader.h"
#include "import/testing/import_fixture.h"
#include "scene/capture_writer.h"

namespace tessera {
namespace {

TEST_F(Import, WritesASelfContainedCapture) {
  for (const char* name : {"images/10.png", "images/9.png", "images/8.png"}) add(name);
  write();
  run();
  fs::remove_all(source_);
  const Capture capture = readCapture(out_);
  ASSERT_EQ(capture.photos.size(), 3u);
  EXPECT_EQ(capture.photos[0].name, "images/8.png");  // natural order
  EXPECT_EQ(capture.photos[2].name, "images/10.png");
  EXPECT_EQ(readImage(capture.photos[2].image).image.pixels, gradientPicture(16, 12, 3, 0).pixels);
  // The world is recentred, and sourceFromWorld records the translation.
  EXPECT_LT(capture.photos[0].worldFromCamera.translation.norm(), 3);
  EXPECT_EQ((capture.sourceFromWorld * capture.photos[2].worldFromCamera.translation.homogeneous()).head<3>(),
            Vec3d(1000, 0, 2));
}

TEST_F(Import, HoldsOutEveryEighthInNaturalOrder) {
  for (int i = 0; i < 20; ++i) add("images/" + std::to_string(i) + ".png");
  write();
  std::vector<std::string> names;
  for (const Capture capture = run(); int i : capture.photosIn(Split::test))
    names.push_back(capture.photos[size_t(i)].name);
  EXPECT_EQ(names, (std::vector<std::string>{"images/0.png", "images/8.png", "images/16.png"}));
  EXPECT_EQ(run({.holdout = "none"}).photosIn(Split::test).size(), 0u);
  EXPECT_EQ(run({.holdout = "every:5"}).photosIn(Split::test).size(), 4u);
  writeFileAtomically(folder_ / "list", std::string_view("# held out\n3.png\nimages/7.png\r\n12\nnone.png\n"));
  EXPECT_EQ(run({.holdout = "list:" + (folder_ / "list").string()}).photosIn(Split::test),
            (std::vector<int>{3, 7, 12}));
  EXPECT_TRUE(logged("1 of 4 names are not photos of this capture (none.png)")) << log_;
  writeFileAtomically(folder_ / "list", std::string_view("./images/4.png\n.//5.png\n"));
  EXPECT_EQ(run({.holdout = "list:" + (folder_ / "list").string()}).photosIn(Split::test), (std::vector<int>{4, 5}));
  EXPECT_FALSE(logged("no photo")) << log_;
  writeFileAtomically(folder_ / "list", std::string_view("photos/3.png\nnone.png\n40\n"));
  EXPECT_NO_THROW(run({.holdout = "list:" + (folder_ / "list").string()}));  // names 3 without its folder
  writeFileAtomically(folder_ / "list", std::string_view("none.png\n40\n"));
  EXPECT_THROW(run({.holdout = "list:" + (folder_ / "list").string()}), Error);
  for (const char* wrong : {"every:", "every:1", "every:x", "some", "list:/nowhere"}) {
    EXPECT_THROW(run({.holdout = wrong}), Error) << wrong;
  }
}

// As of two flights with a camera that counts from 1 again, reduced so that the extension changes.
TEST_F(Import, HoldsOutOnlyPhotosOfTheFoldersThatAListNames) {
  for (const char* flight : {"a", "b"}) {
    for (int i = 0; i < 3; ++i) {
      const std::string name = std::string(flight) + "/" + std::to_string(i) + ".jpg";
      fs::create_directories(source_ / flight);
      writeJpeg(source_ / name, gradientPicture(16, 12, 3, i));
      frames_.push_back({name, ""});
    }
  }
  write();
  const auto heldOut = [&](const std::string& list) {
    writeFileAtomically(folder_ / "list", list);
    return run({.downscale = 2, .holdout = "list:" + (folder_ / "list").string()}).photosIn(Split::test);
  };
  EXPECT_EQ(heldOut("a/1.jpg\n"), (std::vector<int>{1}));
  EXPECT_EQ(heldOut("images/b/2.jpg\n"), (std::vector<int>{5}));
  EXPECT_EQ(heldOut("b/0\n"), (std::vector<int>{3}));
  EXPECT_EQ(heldOut("a/1.jpg\nc/1.jpg\n"), (std::vector<int>{1}));
  EXPECT_TRUE(logged("1 of 2 names are not photos of this capture (c/1.jpg)")) << log_;
  EXPECT_EQ(heldOut("1.jpg\n"), (std::vector<int>{1, 4})) << "of all flights";
}

TEST_F(Import, KeepsTheSourcesOwnSplitByDefault) {
  for (int i = 0; i < 4; ++i) add("images/" + std::to_string(i) + ".png");
  write(R"(,"train_filenames":["images/0.png","images/1.png","images/2.png"],"val_filenames":["images/3.png"])");
  EXPECT_EQ(run().photosIn(Split::test), (std::vector<int>{3}));
  EXPECT_EQ(run({.holdout = "every:2"}).photosIn(Split::test), (std::vector<int>{0, 2}));
}

TEST_F(Import, RejectsSplitsThatMatchNoPhotoBeforeCopyingAny) {
  for (int i = 0; i < 4; ++i) add("images/" + std::to_string(i) + ".png");
  write(R"(,"train_filenames":["images/0.png"],"test_filenames":["3.png"])");
  try {
    run();
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.place(), "test_filenames");
    EXPECT_NE(error.remedy().find("--holdout"), std::string::npos);
  }
  EXPECT_FALSE(fs::exists(out_));
  EXPECT_EQ(run({.holdout = "every:2"}).photosIn(Split::test), (std::vector<int>{0, 2}));
}

TEST_F(Import, WarnsWhenNoPhotoIsHeldOut) {
  for (int i = 0; i < 3; ++i) add("images/" + std::to_string(i) + ".png");
  write(R"(,"train_filenames":["images/0.png","images/1.png","images/2.png"],"test_filenames":[])");
  EXPECT_EQ(run().photosIn(Split::test).size(), 0u);
  EXPECT_TRUE(logged("no photo is held out")) << log_;
  run({.holdout = "none"});
  EXPECT_FALSE(logged("held out")) << log_;
  write(R"(,"test_filenames":["images/0.png","images/1.png","images/2.png"])");
  EXPECT_EQ(run().photosIn(Split::test), (std::vector<int>{0}));
  EXPECT_TRUE(logged("leaves nothing to train on")) << log_;
}

TEST_F(Import, DownscalesByAreaAndScalesTheLens) {
  add("images/a.png");
  add("images/b.png");
  write();
  const Capture capture = run({.downscale = 4});
  EXPECT_EQ(capture.cameras.at(0).width, 4);
  EXPECT_EQ(capture.cameras[0].height, 3);
  EXPECT_EQ(capture.cameras[0].focalX(), 5);
  const ImageU8 full = gradientPicture(16, 12, 3, 0), reduced = readImage(capture.photos[0].image).image;
  double sum = 0;
  for (int y = 4; y < 8; ++y) {
    for (int x = 8; x < 12; ++x) sum += full.at(x, y)[1];
  }
  EXPECT_EQ(reduced.at(2, 1)[1], std::lround(sum / 16));
}

TEST_F(Import, DropsFaultyPhotosWithOneWarningForEachKind) {
  add("images/good.png");
  add("images/again.png");
  frames_.push_back(frames_[1]);
  add("images/half.png", 8, 6);
  add("images/upright.png", 12, 16);
  for (const char* name : {"images/x.png", "images/y.png", "images/z.png", "images/w.png"})
    frames_.push_back({name, ""});
  writeFileAtomically(source_ / "images/text.png", std::string_view("not a picture"));
  frames_.push_back({"images/text.png", ""});
  Bytes jpeg = encodeJpeg(gradientPicture(160, 120), 95);
  jpeg.resize(jpeg.size() / 2);
  writeFileAtomically(source_ / "images/cut.jpg", jpeg);
  frames_.push_back({"images/cut.jpg", ""});
  write();
  const Capture capture = run();
  std::vector<std::string> names;
  for (const Photo& photo : capture.photos) names.push_back(photo.name);
  EXPECT_EQ(names, (std::vector<std::string>{"images/again.png", "images/good.png", "images/half.png"}));
  EXPECT_EQ(capture.cameras[static_cast<size_t>(capture.photos[2].camera)].focalX(), 10);
  EXPECT_TRUE(
      logged("4 photos named by the source are not on disk; dropped (images/x.png, images/y.png, images/z.png, ...)"))
      << log_;
  EXPECT_TRUE(logged("named more than once")) << log_;
  EXPECT_TRUE(logged("another shape than their camera")) << log_;
  EXPECT_TRUE(logged("cannot be read as JPEG or PNG")) << log_;
  EXPECT_TRUE(logged("end early")) << log_;
  EXPECT_EQ(readCapture(out_).photos.size(), 3u);
}

TEST_F(Import, ThrowsWhenNoPhotoIsLeft) {
  frames_.push_back({"images/nowhere.png", ""});
  write();
  EXPECT_THROW(run(), Error);
  EXPECT_FALSE(fs::exists(out_ / "transforms.json"));
}

TEST_F(Import, DropsPanoramasAndFailsWhenThereIsNothingElse) {
  for (const char* name : {"a.png", "b.png"}) writePng(source_ / "images" / name, gradientPicture(16, 8));
  const fs::path model = source_ / "sparse/0";
  writeFileAtomically(model / "images.txt", std::string_view("1 1 0 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 1 0 0 2 b.png\n\n"));
  writeFileAtomically(model / "cameras.txt",
                      std::string_view("1 EQUIRECTANGULAR 16 8 16 8\n2 EUCM 16 8 9 9 8 4 0.6 1.1\n"));
  const Capture capture = run();
  ASSERT_EQ(capture.photos.size(), 1u);
  EXPECT_EQ(capture.cameras.at(0).lens, LensModel::eucm);
  EXPECT_EQ(readCapture(out_).cameras, capture.cameras);
  EXPECT_TRUE(logged("1 photos were taken with the lens EQUIRECTANGULAR")) << log_;
  writeFileAtomically(model / "cameras.txt",
                      std::string_view("1 EQUIRECTANGULAR 16 8 16 8\n2 EQUIRECTANGULAR 16 8 16 8\n"));
  EXPECT_THROW(run(), Error);
}

TEST_F(Import, ImportsMasksAndDepthMaps) {
  add("images/a.png", 16, 12, R"(,"mask_path":"masks/a.png","depth_file_path":"depth/a.exr")");
  add("images/b.png", 16, 12, R"(,"mask_path":"masks/missing.png")");
  ImageU8 mask(16, 12, 1, 255);
  mask.at(5, 5)[0] = 0;
  writePng(source_ / "masks/a.png", mask);
  ImageF depth(16, 12, 1, 3.0f);
  depth.at(9, 9)[0] = 100;
  writeDepthExr(source_ / "depth/a.exr", depth);
  write();
  const Capture capture = run({.downscale = 2});
  const ImageU8 reduced = readImage(capture.photos[0].mask).image;
  EXPECT_EQ(reduced.width, 8);
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) EXPECT_EQ(reduced.at(x, y)[0], x == 2 && y == 2 ? 0 : 255);
  }
  const ImageF read = readDepth(capture.photos[0].depth);
  EXPECT_EQ(read.width, 8);
  for (float value : read.pixels) EXPECT_TRUE(value == 3 || value == 100);  // never a mean across an edge
  EXPECT_TRUE(capture.photos[1].mask.empty());
  EXPECT_TRUE(logged("1 masks are missing or unreadable")) << log_;
}

// Such as masks that hold the classes 0 and 1.
TEST_F(Import, RefusesMasksThatExcludeEverything) {
  for (const std::string name : {"a", "b"}) {
    add("images/" + name + ".png", 16, 12, R"(,"mask_path":"masks/)" + name + R"(.png")");
    writePng(source_ / ("masks/" + name + ".png"), ImageU8(16, 12, 1, 1));
  }
  write();
  try {
    run();
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("masks: excludes all pixels of all photos"), std::string::npos)
        << error.what();
  }
  EXPECT_FALSE(fs::exists(out_ / "transforms.json"));
  writePng(source_ / "masks/b.png", ImageU8(16, 12, 1, 255));
  EXPECT_EQ(run().photos.size(), 2u);
  EXPECT_TRUE(logged("masks exclude all pixels of 1 photos (images/a.png)")) << log_;
}

TEST_F(Import, ScalesDepthMapsOfEitherKindByAppliedScale) {
  add("images/a.png", 16, 12, R"(,"depth_file_path":"depth/a.exr")");
  add("images/b.png", 16, 12, R"(,"depth_file_path":"depth/b.png")");
  add("images/0.png");  // comes first
  writeDepthExr(source_ / "depth/a.exr", ImageF(16, 12, 1, 0.2f));
  writePng(source_ / "depth/b.png", ImageU8(16, 12, 1, 200));
  write(R"(,"applied_scale":2)");
  const Capture capture = run();
  EXPECT_FLOAT_EQ(readDepth(capture.photos.at(1).depth).at(3, 3)[0], 0.4f);
  EXPECT_FLOAT_EQ(readDepth(capture.photos.at(2).depth).at(3, 3)[0], 0.4f);
  // The scale is applied only once.
  const Capture again = importCapture(out_, folder_ / "again");
  EXPECT_FLOAT_EQ(readDepth(again.photos.at(1).depth).at(3, 3)[0], 0.4f);
  EXPECT_FLOAT_EQ(readDepth(again.photos.at(2).depth).at(3, 3)[0], 0.4f);
}

TEST_F(Import, InvertsInstantNgpsDynamicMasks) {
  add("images/a.png");
  add("images/b.png");
  ImageU8 dynamic(16, 12, 3, 0);
  dynamic.at(4, 4)[2] = 1;
  writePng(source_ / "images/dynamic_mask_a.png", dynamic);
  write();
  const Capture capture = run();
  const ImageU8 mask = readImage(capture.photos[0].mask).image;
  EXPECT_EQ(mask.at(4, 4)[0], 0);
  EXPECT_EQ(mask.at(5, 4)[0], 255);
}

TEST_F(Import, ResumesAnInterruptedImport) {
  add("images/a.png");
  add("images/b.png");
  write();
  run({.downscale = 2});
  const auto before = fs::last_write_time(out_ / "images/a.png");
  fs::remove(out_ / "images/b.png");
  fs::remove(out_ / "transforms.json");
  run({.downscale = 2});
  EXPECT_EQ(fs::last_write_time(out_ / "images/a.png"), before);
  EXPECT_TRUE(fs::exists(out_ / "images/b.png"));
  EXPECT_EQ(readImage(run({.downscale = 4}).photos[0].image).image.width, 4);  // another size is imported again
}

// Returns the pixel in the corner, which distinguishes the images of this fixture.
int readCornerPixel(const fs::path& picture) {
  return readImage(picture).image.at(0, 0)[0];
}

TEST_F(Import, ReusesNoImageOfAnotherSource) {
  const std::string mask = R"(,"mask_path":"masks/a.png")";
  add("images/a.png", 16, 12, mask);
  writePng(source_ / "masks/a.png", ImageU8(16, 12, 1, 255));
  write();
  const fs::path first = source_;
  source_ = folder_ / "other";
  frames_.clear();
  add("images/a.png", 16, 12, mask);
  writePng(source_ / "images/a.png", gradientPicture(16, 12, 3, 100));
  ImageU8 black(16, 12, 1, 0);
  std::fill(black.pixels.end() - 4 * 16, black.pixels.end(), uint8_t{255});  // but for some rows
  writePng(source_ / "masks/a.png", black);
  write();
  const fs::path second = source_;
  const auto longAgo = fs::file_time_type::clock::now() - std::chrono::hours(1000);
  for (const fs::path& folder : {first, second}) {
    for (const char* name : {"images/a.png", "masks/a.png"}) fs::last_write_time(folder / name, longAgo);
  }
  for (const int downscale : {2, 1}) {
    source_ = first;
    run({.downscale = downscale});
    const int before = readCornerPixel(out_ / "images/a.png");
    source_ = second;
    const Capture capture = run({.downscale = downscale});
    EXPECT_EQ(readCornerPixel(out_ / "images/a.png"), before + 100);
    EXPECT_EQ(readCornerPixel(capture.photos[0].mask), 0);
  }
  EXPECT_EQ(readCornerPixel(first / "images/a.png"), 0);  // the linked source still exists
}

TEST_F(Import, ReimportsAnImageWhoseSourceWasReplaced) {
  for (const char* name : {"images/a.png", "images/b.png"}) add(name);
  write();
  run({.downscale = 2});
  const auto time = fs::last_write_time(out_ / "images/a.png");
  const int before = readCornerPixel(out_ / "images/b.png");
  writePng(source_ / "images/b.png", gradientPicture(16, 12, 3, 100));
  fs::last_write_time(source_ / "images/b.png", time - std::chrono::hours(1000));  // an older file
  run({.downscale = 2});
  EXPECT_EQ(fs::last_write_time(out_ / "images/a.png"), time);
  EXPECT_EQ(readCornerPixel(out_ / "images/b.png"), before + 99);  // the original had seed 1
}

TEST_F(Import, ReimportsAnImageOfUnknownOrigin) {
  add("images/a.png");
  write();
  run({.downscale = 2});
  const int before = readCornerPixel(out_ / "images/a.png");
  writePng(out_ / "images/a.png", ImageU8(8, 6, 3, 200));
  fs::remove(out_ / "sources.txt");
  run({.downscale = 2});
  EXPECT_EQ(readCornerPixel(out_ / "images/a.png"), before);
}

TEST_F(Import, LeavesPhotosUnchangedWhenImportedInPlace) {
  writePng(source_ / "images/a.png", gradientPicture(16, 12));
  const Bytes before = readFile(source_ / "images/a.png");
  const fs::path model = source_ / "sparse/0";
  writeFileAtomically(model / "images.txt", std::string_view("1 1 0 0 0 0 0 0 1 a.png\n\n"));
  writeFileAtomically(model / "cameras.txt", std::string_view("1 PINHOLE 16 12 9 9 8 6\n"));
  for (int i = 0; i < 2; ++i) importCapture(model, source_);
  EXPECT_EQ(readCapture(source_).photos.size(), 1u);
  EXPECT_THROW(importCapture(model, source_, {.downscale = 2}), Error);
  EXPECT_EQ(readFile(source_ / "images/a.png"), before);
  EXPECT_EQ(readCapture(source_).photos.size(), 1u);  // still complete
}

TEST_F(Import, GivesCollidingImagesUniqueNames) {
  add("images/a.png");
  writeJpeg(source_ / "images/a.jpg", gradientPicture(16, 12));
  frames_.push_back({"images/a.jpg", ""});
  write();
  const Capture capture = run({.downscale = 2});
  EXPECT_NE(capture.photos[0].image, capture.photos[1].image);
  EXPECT_EQ(readCapture(out_).photos.size(), 2u);
}

TEST_F(Import, KeepsAlphaWithoutBleedingOfTransparentPixels) {
  ImageU8 image(16, 12, 4, 0);  // clear black
  for (int x = 0; x < 15; ++x) {
    for (int c = 0; c < 4; ++c) image.at(x, 0)[c] = c == 0 || c == 3 ? 255 : 0;  // opaque red
  }
  for (const char* name : {"images/a.png", "images/b.png"}) {
    add(name);
    writePng(source_ / name, image);
  }
  write();
  const ImageU8 reduced = readImage(run({.downscale = 2}).photos[0].image).image;
  ASSERT_EQ(reduced.channels, 4);
  EXPECT_EQ(reduced.at(0, 0)[0], 255);
  EXPECT_EQ(reduced.at(0, 0)[3], 128);
  EXPECT_EQ(reduced.at(7, 0)[3], 64);
}

TEST_F(Import, NamesTheCommandForAFolderOfPhotos) {
  writePng(source_ / "images/a.png", gradientPicture(8, 8));
  try {
    run();
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.remedy().find("tessera run " + (source_ / "images").string()), std::string::npos);
  }
  fs::remove_all(source_ / "images");
  EXPECT_THROW(run(), Error);
  fs::remove_all(source_);
  EXPECT_THROW(run(), Error);
}

TEST_F(Import, CountsPhotosInSubfoldersAndQuotesTheirPath) {
  fs::remove_all(source_);
  source_ = folder_ / "the pilot's card";
  for (const char* name : {"DCIM/100MEDIA/DJI_0001.JPG", "DCIM/101MEDIA/DJI_0002.JPG", "DCIM/101MEDIA/DJI_0003.DNG"})
    writeFileAtomically(source_ / name, std::string_view("any"));
  try {
    run();
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.reason().find("contains 2 photos but no camera poses"), std::string::npos) << error.reason();
    EXPECT_NE(error.remedy().find("1 others (.DNG)"), std::string::npos) << error.remedy();
    const std::string quoted = "'" + (folder_ / "the pilot'\\''s card").string();
    EXPECT_NE(error.remedy().find("tessera run " + quoted + "' OUT"), std::string::npos) << error.remedy();
  }
}

TEST_F(Import, AsksForJpegWhenTheFormatIsNotSupported) {
  for (const char* name : {"IMG_1.HEIC", "IMG_2.HEIC"}) writeFileAtomically(source_ / name, std::string_view("any"));
  fs::remove_all(source_ / "images");
  try {
    run();
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.reason().find("contains 2 photos (.HEIC)"), std::string::npos) << error.reason();
    EXPECT_NE(error.remedy().find("JPEG"), std::string::npos) << error.remedy();
  }
}

TEST_F(Import, NeverOverwritesItsSource) {
  add("images/a.png");
  write();
  EXPECT_THROW(importCapture(source_, source_ / "images/.."), Error);
}

TEST_F(Import, ImportsItsOwnCapturesUnchanged) {
  for (int i = 0; i < 9; ++i) add("images/" + std::to_string(i) + ".png");
  write();
  Capture first = run();
  first.photos[3].orientation = 8;
  writeCapture(first);
  const Capture second = importCapture(out_, folder_ / "again");
  ASSERT_EQ(second.photos.size(), first.photos.size());
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(second.photos[i].name, first.photos[i].name);
    EXPECT_EQ(second.photos[i].split, first.photos[i].split);
    EXPECT_EQ(second.photos[i].orientation, i == 3 ? 8 : 1);
    EXPECT_EQ(second.photos[i].worldFromCamera.translation, first.photos[i].worldFromCamera.translation);
  }
  EXPECT_EQ(second.sourceFromWorld, first.sourceFromWorld);
}

}  // namespace
}  // namespace tessera
