#include "synth/city.h"

#include <gtest/gtest.h>
#include <libexif/exif-data.h>

#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>
#include <cstdlib>
#include <map>

#include "base/error.h"
#include "base/image_io.h"

namespace tessera {
namespace {

class City : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "tessera_city_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }

  static CityOptions tiny() {
    CityOptions options;
    options.blocksX = options.blocksY = 1;
    options.photos = 10;
    options.width = 32;
    options.height = 24;
    options.seed = 4;
    options.samplesPerPixel = 1;
    options.traffic = true;
    options.exposureJitter = 0.3;
    return options;
  }

  static std::map<std::string, Bytes> filesBelow(const fs::path& root) {
    std::map<std::string, Bytes> files;
    for (const auto& entry : fs::recursive_directory_iterator(root))
      if (entry.is_regular_file()) files[fs::relative(entry.path(), root).string()] = readFile(entry.path());
    return files;
  }

  fs::path folder_;
};

TEST_F(City, IsTheSameBytesForAnyThreadsAndAfterAResume) {
  CityOptions options = tiny();
  options.threads = 1;
  synthesiseCity(folder_ / "a", options);
  const auto first = filesBelow(folder_ / "a");
  options.threads = 3;
  synthesiseCity(folder_ / "b", options);
  EXPECT_EQ(first, filesBelow(folder_ / "b"));

  // The folder after the process was killed: a photo without its image, one without any file, and no transforms.json.
  fs::remove(folder_ / "b/images/photo_0003.jpg");
  fs::remove(folder_ / "b/images/photo_0008.jpg");
  fs::remove(folder_ / "b/depths/photo_0008.exr");
  fs::remove(folder_ / "b/transforms.json");
  const auto writeTime = fs::last_write_time(folder_ / "b/images/photo_0002.jpg");
  synthesiseCity(folder_ / "b", options);
  EXPECT_EQ(first, filesBelow(folder_ / "b"));
  EXPECT_EQ(fs::last_write_time(folder_ / "b/images/photo_0002.jpg"), writeTime)
      << "finished photos are not taken again";
}

TEST_F(City, WritesPhotosDepthsMasksAndTransforms) {
  const CityOptions options = tiny();
  const Capture capture = synthesiseCity(folder_, options);
  ASSERT_EQ(capture.photos.size(), 10u);
  double exposure = 0;
  for (size_t i = 0; i < capture.photos.size(); ++i) {
    const Photo& photo = capture.photos[i];
    EXPECT_EQ(photo.split, i % 8 == 0 ? Split::test : Split::train);
    EXPECT_TRUE(i == 0 || naturalLess(capture.photos[i - 1].name, photo.name));
    const DecodedImage picture = readImage(photo.image), mask = readImage(photo.mask);
    EXPECT_EQ(picture.image.width, 32);
    EXPECT_EQ(mask.image.channels, 1);
    const ImageF depth = readDepth(photo.depth);
    EXPECT_EQ(depth.height, 24);
    exposure += photo.exposure.value();
  }
  EXPECT_NEAR(exposure, 0, 1e-9);
  EXPECT_NE(capture.photos[0].exposure, capture.photos[1].exposure);
  EXPECT_GT(capture.points.size(), 50u);
  EXPECT_TRUE(fs::exists(folder_ / "transforms.json"));
}

TEST_F(City, AgreesOnPlacesInExifAndInPoses) {
  const Capture capture = synthesiseCity(folder_, tiny());
  ASSERT_TRUE(capture.geo.has_value());
  const GeographicLib::LocalCartesian earth(capture.geo->latitude, capture.geo->longitude, capture.geo->altitude);
  for (const Photo& photo : capture.photos) {
    ExifData* data = exif_data_new_from_file(photo.image.c_str());
    ASSERT_NE(data, nullptr);
    const auto rational = [&](int tag, int index) {
      const ExifEntry* entry = exif_content_get_entry(data->ifd[EXIF_IFD_GPS], static_cast<ExifTag>(tag));
      if (entry == nullptr) return 1e9;
      const ExifRational r = exif_get_rational(entry->data + 8 * index, exif_data_get_byte_order(data));
      return static_cast<double>(r.numerator) / r.denominator;
    };
    const auto degrees = [&](int tag) { return rational(tag, 0) + rational(tag, 1) / 60 + rational(tag, 2) / 3600; };
    Vec3d x;
    earth.Forward(degrees(2), degrees(4), rational(6, 0), x.x(), x.y(), x.z());
    exif_data_unref(data);
    EXPECT_LT((x - photo.worldFromCamera.translation).norm(), 2e-3) << photo.name;
  }
}

TEST_F(City, PutsErrorsOfGpsIntoFixesAndNotIntoPoses) {
  CityOptions options = tiny();
  options.photos = 60;
  options.width = 12;
  options.height = 9;
  options.gpsNoise = 2;
  options.gpsHeightNoise = 0.5;
  options.heightOffsets = {15};
  const Capture capture = synthesiseCity(folder_, options);
  const GeographicLib::LocalCartesian earth(capture.geo->latitude, capture.geo->longitude, capture.geo->altitude);
  Vec3d squares = Vec3d::Zero();
  std::vector<double> heights;
  int tooHigh = 0;
  for (const Photo& photo : capture.photos) {
    Vec3d error;
    earth.Forward(photo.gps->latitude, photo.gps->longitude, photo.gps->altitude, error.x(), error.y(), error.z());
    error -= photo.worldFromCamera.translation;
    if (error.z() > 10) {
      ++tooHigh;
      error.z() -= 15;
    }
    squares += error.cwiseAbs2();
    heights.push_back(photo.gps->altitude - photo.gps->relativeAltitude);
  }
  const Vec3d deviation = (squares / 60).cwiseSqrt();
  const auto [least, greatest] = std::minmax_element(heights.begin(), heights.end());
  EXPECT_LT(*greatest - *least, 0.2) << "that of the take-off, but for the curve of the Earth";
  EXPECT_EQ(tooHigh, 9) << "the first of twelve flights";
  EXPECT_NEAR(deviation.x(), 2, 0.5);
  EXPECT_NEAR(deviation.y(), 2, 0.5);
  EXPECT_NEAR(deviation.z(), 0.5, 0.15);
}

TEST_F(City, WritesPhotosWithoutTagsIfAskedTo) {
  CityOptions options = tiny();
  options.photos = 1;
  options.exif = false;
  const Capture capture = synthesiseCity(folder_, options);
  EXPECT_FALSE(capture.photos[0].gps);
  const std::string photo = readTextFile(capture.photos[0].image);
  EXPECT_EQ(photo.find("Exif"), photo.npos);
  EXPECT_EQ(photo.find("xmpmeta"), photo.npos);
}

TEST_F(City, ChangesWithTheSeed) {
  CityOptions options = tiny();
  options.photos = 2;
  synthesiseCity(folder_ / "a", options);
  options.seed = 5;
  synthesiseCity(folder_ / "b", options);
  EXPECT_NE(readFile(folder_ / "a/images/photo_0000.jpg"), readFile(folder_ / "b/images/photo_0000.jpg"));
}

TEST_F(City, RefusesAFolderThatHoldsAnotherCity) {
  CityOptions options = tiny();
  options.photos = 1;
  synthesiseCity(folder_, options);
  options.seed = 5;
  EXPECT_THROW(synthesiseCity(folder_, options), Error);
}

TEST_F(City, RejectsOptionsThatCannotBeBuilt) {
  for (auto spoil : {+[](CityOptions& o) { o.blocksX = 0; }, +[](CityOptions& o) { o.width = 0; },
                     +[](CityOptions& o) { o.altitudes.clear(); }, +[](CityOptions& o) { o.altitudes = {5}; },
                     +[](CityOptions& o) { o.photos = -1; }, +[](CityOptions& o) { o.samplesPerPixel = 0; },
                     +[](CityOptions& o) { o.exposureJitter = std::nan(""); }, +[](CityOptions& o) { o.overlap = 0.5; },
                     +[](CityOptions& o) { o.photos = 0, o.overlap = 1; }, +[](CityOptions& o) { o.gpsNoise = -1; },
                     +[](CityOptions& o) { o.heightOffsets = {1e9}; }}) {
    CityOptions options = tiny();
    spoil(options);
    EXPECT_THROW(synthesiseCity(folder_ / "never", options), Error);
    EXPECT_FALSE(fs::exists(folder_ / "never"));
  }
}

}  // namespace
}  // namespace tessera
