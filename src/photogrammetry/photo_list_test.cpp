#include "photogrammetry/photo_list.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/image_io.h"
#include "base/testing/temporary_folder.h"
#include "photogrammetry/testing/survey_photos.h"

namespace tessera {
namespace {

class PhotoLists : public testing::Test {
 protected:
  PhotoList list() {
    ThreadPool pool(2);
    return listPhotos(folder_.path(), pool);
  }
  void write(const std::string& name, int shade = 0) {
    writeJpeg(folder_ / name, ImageU8(8, 6, 3, static_cast<uint8_t>(shade)));
  }
  TemporaryFolder folder_;
};

TEST_F(PhotoLists, NameEachPhotoOnceInNaturalOrder) {
  write("b/DJI 10.jpg", 1);
  write("b/DJI 9.jpg", 2);
  write("a/DJI 9.jpg", 3);
  write("a_DJI_9.jpg", 4);
  const PhotoList list = this->list();
  ASSERT_EQ(list.photos.size(), 4u);
  EXPECT_EQ(list.photos[0].name, "a/DJI 9.jpg");
  EXPECT_EQ(list.photos[2].name, "b/DJI 9.jpg");
  EXPECT_EQ(list.photos[3].name, "b/DJI 10.jpg");
  EXPECT_EQ(list.photos[0].safeName, "a_DJI_9.jpg");
  EXPECT_EQ(list.photos[1].safeName, "a_DJI_9_2.jpg") << "another photo has that name";
}

TEST_F(PhotoLists, LeaveOutWhatIsNoPhotoOrACopy) {
  write("one.jpg", 1);
  fs::copy_file(folder_ / "one.jpg", folder_ / "two.jpg");
  writeFileAtomically(folder_ / "broken.jpg", "no picture");
  writeFileAtomically(folder_ / "notes.txt", "of the flight");
  fs::create_directories(folder_ / ".trash");
  fs::copy_file(folder_ / "one.jpg", folder_ / ".trash/three.jpg");
  const PhotoList list = this->list();
  ASSERT_EQ(list.photos.size(), 1u);
  ASSERT_EQ(list.leftOut.size(), 2u);
  EXPECT_EQ(list.leftOut[0].name + " " + list.leftOut[0].reason, "broken.jpg not readable as JPEG or PNG");
  EXPECT_EQ(list.leftOut[1].name + " " + list.leftOut[1].reason, "two.jpg the same file as another photo");
}

TEST_F(PhotoLists, FollowSymbolicLinks) {
  write("one.jpg", 1);
  const fs::path elsewhere = folder_ / ".elsewhere";
  fs::create_directories(elsewhere / "more");
  writeJpeg(elsewhere / "two.jpg", ImageU8(8, 6, 3, 2));
  writeJpeg(elsewhere / "more/three.jpg", ImageU8(8, 6, 3, 3));
  fs::create_symlink(elsewhere / "two.jpg", folder_ / "two.jpg");
  fs::create_directory_symlink(elsewhere / "more", folder_ / "more");
  fs::create_directory_symlink(folder_.path(), elsewhere / "more/back");
  fs::create_symlink(elsewhere / "absent.jpg", folder_ / "absent.jpg");
  const PhotoList list = this->list();
  ASSERT_EQ(list.photos.size(), 3u);
  EXPECT_EQ(list.photos[0].name, "more/three.jpg");
  EXPECT_EQ(list.photos[2].name, "two.jpg");
  EXPECT_TRUE(list.leftOut.empty());
}

// Phones store depth maps, and drones thermal pictures, in front of the picture.
TEST_F(PhotoLists, ReadPhotosWithMoreThanAMegabyteOfTags) {
  Bytes jpeg = encodeJpeg(ImageU8(8, 6, 3), 90);
  Bytes segment(65002, std::byte{1});
  for (const auto& [at, value] : {std::pair(0, 0xff), {1, 0xe2}, {2, 65000 >> 8}, {3, 65000 & 255}})
    segment[static_cast<size_t>(at)] = static_cast<std::byte>(value);
  for (int i = 0; i < 30; ++i) jpeg = withSegment(jpeg, segment);
  writeFileAtomically(folder_ / "one.jpg", jpeg);
  const PhotoList list = this->list();
  ASSERT_EQ(list.photos.size(), 1u);
  EXPECT_EQ(list.bodies[0].width, 8);
}

// Cameras write both of each picture.
TEST_F(PhotoLists, IgnoreRawPicturesBesidePhotos) {
  write("a/DJI_1.JPG", 1);
  writeFileAtomically(folder_ / "a/DJI_1.DNG", std::string_view("raw"));
  writeFileAtomically(folder_ / "a/DJI_2.dng", std::string_view("raw"));
  writeFileAtomically(folder_ / "b/DJI_1.dng", std::string_view("raw"));
  const PhotoList list = this->list();
  EXPECT_EQ(list.photos.size(), 1u);
  ASSERT_EQ(list.leftOut.size(), 2u);
  EXPECT_EQ(list.leftOut[0].name, "a/DJI_2.dng");
  EXPECT_EQ(list.leftOut[1].name, "b/DJI_1.dng");
}

TEST_F(PhotoLists, LeaveOutSmallerCopies) {
  const auto write = [&](const std::string& name, int width, int height, double seconds) {
    const ImageU8 picture(width, height, 3, static_cast<uint8_t>(name.size()));
    writeFileAtomically(folder_ / name, encodeJpeg(picture, 90, encodeExif({.seconds = seconds})));
  };
  write("flight/DJI_1.jpg", 16, 12, 0);
  write("small/dji_1.JPG", 8, 6, 0);
  write("other_camera/DJI_1.jpg", 16, 12, 0);  // which releases together with the first
  write("later/DJI_1.jpg", 8, 6, 60);          // of another flight, whose numbers begin anew
  write("flight/DJI_2.jpg", 8, 6, 0);          // of a series in one second
  write("wide/DJI_1.jpg", 8, 4, 0);            // of another shape
  writeFileAtomically(folder_ / "@eaDir/DJI_1.jpg/SYNOPHOTO_THUMB_XL.jpg", encodeJpeg(ImageU8(4, 3, 3), 90));
  const PhotoList list = this->list();
  std::string names;
  for (const ListedPhoto& photo : list.photos) names += photo.name + " ";
  EXPECT_EQ(names, "flight/DJI_1.jpg flight/DJI_2.jpg later/DJI_1.jpg other_camera/DJI_1.jpg wide/DJI_1.jpg ");
  ASSERT_EQ(list.leftOut.size(), 1u);
  EXPECT_EQ(list.leftOut[0].name, "small/dji_1.JPG");
  EXPECT_EQ(list.leftOut[0].reason, "a smaller copy of another photo");
}

// As of a network drive that is away: the photo must not count as one that cannot be decoded.
TEST_F(PhotoLists, AreNotThoseOfADiskThatFails) {
  write("one.jpg", 1);
  fs::create_symlink("/proc/self/mem", folder_ / "two.jpg");  // which cannot be read
  EXPECT_THROW(list(), Error);
}

TEST_F(PhotoLists, LeaveOutNamesThatACaptureCannotHave) {
  write("one.jpg", 1);
  write(
      "S\xfc"
      "d.jpg",
      2);
  const PhotoList list = this->list();
  EXPECT_EQ(list.photos.size(), 1u);
  ASSERT_EQ(list.leftOut.size(), 1u);
  EXPECT_EQ(list.leftOut[0].reason, "its name is not UTF-8; rename it");
}

TEST_F(PhotoLists, TellSizesApartAsCameras) {
  writeJpeg(folder_ / "a.jpg", ImageU8(8, 6, 3));
  writeJpeg(folder_ / "b.jpg", ImageU8(6, 8, 3));
  const PhotoList list = this->list();
  ASSERT_EQ(list.bodies.size(), 2u);
  EXPECT_EQ(list.bodies[0].name, "unknown camera, 8x6");
  EXPECT_EQ(list.bodies[0].focalLength, 0);
}

TEST_F(PhotoLists, SeparateFlightsByPauses) {
  for (int i = 0; i < 6; ++i)
    writeSurveyPhoto(folder_ / ("p" + std::to_string(i) + ".jpg"), {.seconds = i * 3.0 + (i >= 4 ? 400 : 0)});
  const PhotoList list = this->list();
  ASSERT_EQ(list.photos.size(), 6u);
  EXPECT_EQ(list.flights, 2);
  EXPECT_EQ(list.photos[3].flight, 0);
  EXPECT_EQ(list.photos[4].flight, 1);
  EXPECT_EQ(list.bodies.size(), 1u);
  EXPECT_NEAR(list.bodies[0].focalLength, 28.0 / 36 * 8, 1e-9);
}

// The battery was exchanged in two minutes.
TEST_F(PhotoLists, SeparateFlightsByShortLandingsIfTakeOffAltitudesJump) {
  // Eight photos, of which the last four are taken after a pause; `heights`: above take-off.
  const auto flights = [this](double pause, const std::vector<double>& altitudes, const std::vector<double>& heights) {
    for (size_t i = 0; i < 8; ++i) {
      writeSurveyPhoto(folder_ / ("p" + std::to_string(i) + ".jpg"),
                       {.gps = {46.5, 6.5, altitudes[i], heights[i]},
                        .seconds = 3.0 * static_cast<double>(i) + (i >= 4 ? pause : 0)});
    }
    return list().flights;
  };
  const std::vector<double> high(8, 50.0), unknown(8, 0.0);
  const std::vector<double> jump{400, 400, 400, 400, 405, 405, 405, 405};
  EXPECT_EQ(flights(120, jump, high), 2);
  EXPECT_EQ(list().photos[3].flight, 0);
  EXPECT_EQ(list().photos[4].flight, 1);
  EXPECT_EQ(flights(20, jump, high), 1) << "too short to land";
  EXPECT_EQ(flights(120, jump, unknown), 1) << "it has climbed";
  EXPECT_EQ(flights(120, {400, 400, 400, 400, 401, 401, 401, 401}, high), 1) << "an error of the barometer";
  EXPECT_EQ(flights(120, {400, 402, 404, 406, 409, 411, 413, 415}, high), 1) << "absolute altitudes that drift";
  // A photo on the ground between the two.
  EXPECT_EQ(flights(120, jump, {50, 50, 50, 50, 0, 50, 50, 50}), 2);
  EXPECT_EQ(list().photos[4].flight, 1);
}

TEST_F(PhotoLists, CountZoomAndUprightPicturesToTheSameFlight) {
  for (int i = 0; i < 6; ++i) {
    const bool isUpright = i == 2;
    const ExifFields exif{.focalLength35 = 28.0 + 10 * (i % 3), .seconds = 3.0 * i};
    writeFileAtomically(folder_ / ("p" + std::to_string(i) + ".jpg"),
                        encodeJpeg(ImageU8(isUpright ? 6 : 8, isUpright ? 8 : 6, 3), 90, encodeExif(exif)));
  }
  const PhotoList list = this->list();
  EXPECT_EQ(list.bodies.size(), 4u);
  EXPECT_EQ(list.flights, 1);
}

TEST_F(PhotoLists, RefuseAFolderThatIsNotThere) {
  ThreadPool pool(1);
  EXPECT_THROW(listPhotos(folder_ / "none", pool), Error);
}

TEST(FocalLengths, FollowFromTheFieldOfViewOrTheSensor) {
  EXPECT_NEAR(focalLengthInPixels({.focalLength35 = 24}, 4000, 3000), 24.0 / 36 * 4000, 1e-9);
  EXPECT_NEAR(focalLengthInPixels({.focalLength35 = 24}, 3000, 4000), 24.0 / 36 * 4000, 1e-9);
  CameraTags bySensor{.focalLength = 8.8, .pixelsPerMillimetre = 416, .recordedPixels = 5472};
  EXPECT_NEAR(focalLengthInPixels(bySensor, 5472, 3648), 8.8 * 416, 1e-9);
  EXPECT_NEAR(focalLengthInPixels(bySensor, 1368, 912), 8.8 * 416 / 4, 1e-9) << "reduced by a program that keeps tags";
  EXPECT_NEAR(focalLengthInPixels(bySensor, 3648, 5472), 8.8 * 416, 1e-9);
  bySensor.recordedPixels = 0;
  EXPECT_EQ(focalLengthInPixels(bySensor, 5472, 3648), 0) << "it may be a reduced picture";
  bySensor = {.focalLength = 8.8, .pixelsPerMillimetre = 41600, .recordedPixels = 5472};
  EXPECT_EQ(focalLengthInPixels(bySensor, 5472, 3648), 0) << "implausible";
  EXPECT_EQ(focalLengthInPixels({.focalLength35 = 65535}, 4000, 3000), 0);
  EXPECT_EQ(focalLengthInPixels({}, 5472, 3648), 0);
}

}  // namespace
}  // namespace tessera
