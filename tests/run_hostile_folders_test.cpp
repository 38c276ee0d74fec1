// `tessera run` on folders as they come: each ends with the line that tells the user what is wrong, or with poses and a
// warning; none with poses that are silently wrong.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>

#include "base/image_io.h"
#include "base/random.h"
#include "base/testing/shared_data.h"
#include "base/testing/temporary_folder.h"
#include "tests/program.h"

namespace tessera {
namespace {

// Photos of the fox overlap well; they have no EXIF.
void writeFoxPhoto(const fs::path& file, int number) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(sharedData("fox") / "images")) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  writeJpeg(file, downscaleByArea(readImage(files.at(static_cast<size_t>(number))).image, 540, 960));
}

void writeFox(const fs::path& folder, int count) {
  for (int i = 0; i < count; ++i) writeFoxPhoto(folder / ("fox" + std::to_string(i) + ".jpg"), i);
}

void writeBeachPhoto(const fs::path& file, int number) {
  const fs::path source = sharedData("brighton_beach") / "images" / ("DJI_00" + std::to_string(18 + number) + ".JPG");
  writeJpeg(file, downscaleByArea(readImage(source).image, 800, 450));
}

// A photo of the fox as a camera in the same place sees it that is turned by `degrees`.
void writeTurnedFox(const fs::path& file, double degrees) {
  const ImageU8 picture = downscaleByArea(readImage(sharedData("fox") / "images/0001.jpg").image, 540, 960);
  constexpr int kSide = 480;
  const double focal = 1.2 * 960, angle = degrees * 3.14159265358979 / 180;
  ImageU8 turned(kSide, kSide, 3);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const double right = (x + 0.5 - kSide / 2) / focal, down = (y + 0.5 - kSide / 2) / focal;
      // Turned about the horizontal axis.
      const double depth = std::cos(angle) - down * std::sin(angle), below = down * std::cos(angle) + std::sin(angle);
      const double u = right / depth * focal + 270 - 0.5, v = below / depth * focal + 480 - 0.5;
      const int column = std::clamp(static_cast<int>(u), 0, 538), row = std::clamp(static_cast<int>(v), 0, 958);
      const double fx = u - column, fy = v - row;
      for (int c = 0; c < 3; ++c) {
        const double above = picture.at(column, row)[c] * (1 - fx) + picture.at(column + 1, row)[c] * fx,
                     under = picture.at(column, row + 1)[c] * (1 - fx) + picture.at(column + 1, row + 1)[c] * fx;
        turned.at(x, y)[c] = static_cast<uint8_t>(above * (1 - fy) + under * fy + 0.5);
      }
    }
  }
  writeJpeg(file, turned);
}

void writeNoise(const fs::path& file, uint64_t seed) {
  ImageU8 picture(320, 240, 3);
  const RandomStream random(seed, 1);
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] = static_cast<uint8_t>(random.uniformDouble(i / 48) * 255);
  writeJpeg(file, picture);
}

// Puts a segment of XMP behind the first two bytes of a JPEG.
void addXmp(const fs::path& file, const std::string& properties) {
  const std::string jpeg = readTextFile(file);
  const std::string xmp = std::string("http://ns.adobe.com/xap/1.0/") + '\0' + "<x:xmpmeta><rdf:Description " +
                          properties + "/></x:xmpmeta>";
  const size_t length = xmp.size() + 2;
  std::string segment{'\xff', '\xe1', static_cast<char>(length >> 8), static_cast<char>(length & 255)};
  writeFileAtomically(file, jpeg.substr(0, 2) + segment + xmp + jpeg.substr(2));
}

// Returns the centres of the cameras of transforms.json by their numbers: of "images/0007.jpg" or "images/fox7.jpg".
std::map<int, Eigen::Vector3d> readCentres(const fs::path& file) {
  const auto json = nlohmann::json::parse(readTextFile(file));
  std::map<int, Eigen::Vector3d> centres;
  for (const auto& frame : json["frames"]) {
    const std::string name = fs::path(frame["file_path"].get<std::string>()).stem().string();
    Eigen::Vector3d& centre = centres[std::atoi(name.c_str() + name.find_first_of("0123456789"))];
    for (size_t i = 0; i < 3; ++i) centre[static_cast<Eigen::Index>(i)] = frame["transform_matrix"][i][3].get<double>();
  }
  return centres;
}

// Returns by how much the poses of the photos that writeFox wrote differ from the known ones after the best similarity,
// relative to their spread.
double errorOfFox(const fs::path& capture) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(sharedData("fox") / "images")) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  const std::map<int, Eigen::Vector3d> known = readCentres(sharedData("fox") / "transforms.json");
  const std::map<int, Eigen::Vector3d> centres = readCentres(capture / "transforms.json");
  Eigen::Matrix3Xd theirs(3, static_cast<Eigen::Index>(centres.size())), ours = theirs;
  Eigen::Index column = 0;
  for (const auto& [number, centre] : centres) {
    ours.col(column) = centre;
    theirs.col(column++) = known.at(std::atoi(files.at(static_cast<size_t>(number)).stem().c_str()));
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(ours, theirs);
  const Eigen::Matrix3Xd mapped = (similarity * ours.colwise().homogeneous()).topRows<3>();
  return (mapped - theirs).norm() / (theirs.colwise() - theirs.rowwise().mean()).norm();
}

struct HostileFolder {
  const char* name;
  bool needsColmap;  // and real photos
  std::function<void(const fs::path&)> write;
  std::string until;
  int exitCode;
  std::vector<std::string> lines;  // parts of them
  bool isFox = false;              // what is placed are photos of writeFox
};

std::ostream& operator<<(std::ostream& out, const HostileFolder& folder) {
  return out << folder.name;
}

const HostileFolder kFolders[] = {
    {"Empty",
     false,
     [](const fs::path& f) { fs::create_directories(f); },
     "inspect",
     1,
     {"holds 0 photos that can be used; poses need three"}},
    {"OfOtherFormats",
     false,
     [](const fs::path& f) {
       for (const char* name : {"a.DNG", "b.heic", "c.tif"}) writeFileAtomically(f / name, "raw");
     },
     "inspect",
     1,
     {"3 photos left out: in a format that is not read; convert it to JPEG", "holds 0 photos"}},
    {"OfEmptyFiles",
     false,
     [](const fs::path& f) {
       for (const char* name : {"a.jpg", "b.jpg", "c.png"}) writeFileAtomically(f / name, "");
     },
     "inspect",
     1,
     {"3 photos left out: not readable as JPEG or PNG (a.jpg, b.jpg, c.png)"}},
    {"OfCopies",
     false,
     [](const fs::path& f) {
       for (int i = 0; i < 8; ++i) writeNoise(f / (std::to_string(i) + ".jpg"), 1);
     },
     "inspect",
     1,
     {"7 photos left out: the same file as another photo", "holds 1 photos"}},
    {"WithAHugePicture",
     false,
     [](const fs::path& f) {
       for (int i = 0; i < 3; ++i) writeNoise(f / (std::to_string(i) + ".jpg"), static_cast<uint64_t>(i));
       Bytes png = encodePng(ImageU8(8, 8, 3));
       for (const size_t at : {16, 20}) png[at + 1] = std::byte{1};  // width and height: above 65536
       writeFileAtomically(f / "huge.png", png);
     },
     "inspect",
     0,
     {"1 photo left out: not readable as JPEG or PNG (huge.png)", "3 photos, 0 with GPS, 1 left out"}},
    {"WithInfraredTwins",
     false,
     [](const fs::path& f) {
       for (int i = 0; i < 6; ++i) {
         const fs::path file = f / (std::to_string(i) + (i % 2 == 0 ? "_V.jpg" : "_T.jpg"));
         writeNoise(file, static_cast<uint64_t>(i));
         addXmp(file, i % 2 == 0 ? "drone-dji:ImageSource=\"WideCamera\"" : "drone-dji:ImageSource=\"InfraredCamera\"");
       }
     },
     "inspect",
     0,
     {"3 photos left out: infrared (1_T.jpg, 3_T.jpg, 5_T.jpg)", "3 photos, 0 with GPS"}},
    {"OfPanoramas",
     false,
     [](const fs::path& f) {
       for (int i = 0; i < 3; ++i) {
         writeNoise(f / (std::to_string(i) + ".jpg"), static_cast<uint64_t>(i));
         addXmp(f / (std::to_string(i) + ".jpg"), "GPano:ProjectionType=\"equirectangular\"");
       }
     },
     "inspect",
     1,
     {"3 photos left out: a panorama, whose lens is not supported", "holds 0 photos"}},
    {"WithLinksInACircle",
     false,
     [](const fs::path& f) {
       for (int i = 0; i < 3; ++i) writeNoise(f / (std::to_string(i) + ".jpg"), static_cast<uint64_t>(i));
       fs::create_directory_symlink(f, f / "again");
       fs::create_symlink(f / "nothing", f / "dangling.jpg");
     },
     "inspect",
     0,
     {"3 photos, 0 with GPS, 0 left out"}},
    {"WithNothingInCommon",
     true,
     [](const fs::path& f) {
       for (int i = 0; i < 4; ++i) writeNoise(f / (std::to_string(i) + ".jpg"), static_cast<uint64_t>(i));
     },
     "capture",
     1,
     {"no two photos could be placed relative to each other", "overlap by more than half"}},
    {"WithoutFeatures",
     true,
     [](const fs::path& f) {
       for (int i = 0; i < 4; ++i)
         writeJpeg(f / (std::to_string(i) + ".jpg"), ImageU8(320, 240, 3, static_cast<uint8_t>(60 + i)));
     },
     "capture",
     1,
     {"no photo has features"}},
    {"WithATruncatedPhoto",
     true,
     [](const fs::path& f) {
       writeFox(f, 6);
       const std::string jpeg = readTextFile(f / "fox5.jpg");
       writeFileAtomically(f / "fox5.jpg", jpeg.substr(0, jpeg.size() / 3));
     },
     "capture",
     0,
     {"truncated", "fox5.jpg", "5 photos, 0 held out"},
     true},
    {"OfTwoPlaces",
     true,
     [](const fs::path& f) {
       writeFox(f, 6);
       for (int i = 0; i < 3; ++i) writeBeachPhoto(f / ("beach" + std::to_string(i) + ".jpg"), i);
     },
     "capture",
     0,
     {"3 photos left out: ", "beach0.jpg", "6 photos, 0 held out"},
     true},
    {"WithNamesThatConfuse",
     true,
     [](const fs::path& f) {
       const std::string names[] = {
           "-rf.jpg",         "a b/0001.jpg",          "c'd\"/0001.jpg",
           "line\nbreak.jpg", "$(touch pwned)`;&.jpg", std::string(150, 'x') + "/" + std::string(150, 'x') + ".jpg"};
       for (int i = 0; i < 6; ++i) writeFoxPhoto(f / names[i], i);
     },
     "capture",
     0,
     {"6 photos, 0 held out"}},
    {"OfOneStop",
     true,
     [](const fs::path& f) {
       // A camera that only turns sees no depth.
       for (int i = 0; i < 5; ++i) writeTurnedFox(f / (std::to_string(i) + ".jpg"), 2.5 * (i - 2));
     },
     "capture",
     1,
     {"no two photos could be placed relative to each other", "taken from different places"}},
    {"WithOneFixForAll",
     true,
     [](const fs::path& f) {
       writeFox(f, 6);
       for (int i = 0; i < 6; ++i) {
         addXmp(f / ("fox" + std::to_string(i) + ".jpg"),
                "drone-dji:GpsLatitude=\"+50.8\" drone-dji:GpsLongitude=\"-0.1\"");
       }
     },
     "capture",
     0,
     {"no geo reference: the photos with GPS stand on one line", "6 photos, 0 held out"},
     true},
};

class HostileFolders : public testing::TestWithParam<HostileFolder> {};

TEST_P(HostileFolders, EndWithWhatIsWrong) {
  const HostileFolder& hostile = GetParam();
  if (hostile.needsColmap) {
    SKIP_WITHOUT_SHARED_DATA("brighton_beach");
    SKIP_WITHOUT_SHARED_DATA("fox");
    if (!isInPath("colmap")) {
      ASSERT_FALSE(sharedDataIsRequired()) << "colmap is not installed";
      GTEST_SKIP() << "colmap is not installed";
    }
  }
  const TemporaryFolder folder;
  hostile.write(folder / "photos");
  const auto begun = std::chrono::steady_clock::now();
  const Said said = Program(folder.path(), {"run", (folder / "photos").string(), (folder / "out").string(), "--until",
                                            hostile.until, "--holdout", "none"})
                        .wait();
  EXPECT_EQ(said.exitCode, hostile.exitCode) << said.out << said.err;
  for (const std::string& line : hostile.lines)
    EXPECT_TRUE(contains(said.out + said.err, line)) << line << "\n" << said.out << said.err;
  size_t errors = 0;
  for (size_t at = said.err.find("error: "); at != said.err.npos; at = said.err.find("error: ", at + 1)) ++errors;
  EXPECT_EQ(errors, hostile.exitCode == 0 ? 0u : 1u) << said.err;
  const fs::path capture = folder / "out/capture";
  if (hostile.isFox) {
    RecordProperty("error", std::to_string(errorOfFox(capture)));
    EXPECT_LT(errorOfFox(capture), 0.15) << "wrong poses";
  }
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::minutes(3));
#endif
  EXPECT_FALSE(fs::exists(fs::current_path() / "pwned"));
}

INSTANTIATE_TEST_SUITE_P(Run, HostileFolders, testing::ValuesIn(kFolders),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace tessera
