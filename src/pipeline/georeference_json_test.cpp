#include "pipeline/georeference_json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

class GeoreferenceJson : public testing::Test {
 protected:
  // Three photos, of which only the last two have a fix.
  static SourceCapture source() {
    SourceCapture source;
    for (const char* name : {"a.jpg", "b.jpg", "\xff.jpg"}) {
      Photo photo;
      photo.name = name;
      photo.worldFromCamera.translation = Vec3d(1, 2, static_cast<double>(source.capture.photos.size()));
      source.capture.photos.push_back(photo);
    }
    source.flight = {0, 1, 0};
    return source;
  }
  static Georeference fit() {
    Georeference fit;
    fit.frame.enuFromWorld.topLeftCorner<3, 3>() *= 10;
    fit.frame.enuFromWorld(0, 3) = 7;
    fit.inliers = 1;
    fit.fixes = 2;
    fit.ignoresTakeOff = true;
    fit.rmsMetres = 0.5;
    fit.heightsTooHigh = {0, 15};
    fit.residuals = {{1, {1, 2, 3}, {0.3, 0.3, 0.4}, true}, {2, {100, 0, -3}, {0.3, 0.3, 0.4}, false}};
    fit.horizontalDeviation = 0.3;
    fit.verticalDeviation = 0.4;
    fit.scaleError = 0.01;
    fit.rotationError = 0.2;
    fit.middleError = 0.1;
    fit.bend = Georeference::Bend{-2, 0.1};
    return fit;
  }

  TemporaryFolder folder_;
  fs::path file_ = folder_ / "georeference.json";
};

TEST_F(GeoreferenceJson, ReadsWhatItWrites) {
  writeGeoreference(file_, fit(), "", source());
  const GeoreferenceFile read = readGeoreference(file_);
  EXPECT_EQ(read.reason, "");
  EXPECT_EQ(read.inliers, 1);
  EXPECT_EQ(read.fixes, 2);
  EXPECT_EQ(read.rmsMetres, 0.5);
  EXPECT_TRUE(read.ignoresTakeOff);
  EXPECT_EQ(read.heightsTooHigh, (std::vector<double>{0, 15}));
  EXPECT_EQ(read.horizontalDeviation, 0.3);
  EXPECT_EQ(read.verticalDeviation, 0.4);
  EXPECT_EQ(read.scaleError, 0.01);
  EXPECT_EQ(read.rotationError, 0.2);
  EXPECT_EQ(read.middleError, 0.1);
  ASSERT_TRUE(read.bend.has_value());
  EXPECT_EQ(read.bend->metres, -2);
  EXPECT_TRUE(read.isBent);
  ASSERT_EQ(read.residuals.size(), 2u);
  EXPECT_EQ(read.residuals[0].photo, "b.jpg");
  EXPECT_EQ(read.residuals[0].flight, 1);
  EXPECT_EQ(read.residuals[0].position, Vec3d(17, 20, 10));
  EXPECT_EQ(read.residuals[0].metres, Vec3d(1, 2, 3));
  EXPECT_EQ(read.residuals[0].predicted, Vec3d(0.3, 0.3, 0.4));
  EXPECT_TRUE(read.residuals[0].isInlier);
  EXPECT_EQ(read.residuals[1].photo, "\xef\xbf\xbd.jpg") << "U+FFFD: the name is not UTF-8";
  EXPECT_FALSE(read.residuals[1].isInlier);
}

TEST_F(GeoreferenceJson, NamesPhotosWhoseFixesDisagree) {
  writeGeoreference(file_, fit(), "", source());
  const std::string text = describeDisagreeing(readGeoreference(file_));
  EXPECT_EQ(text.find("1 of 2 GPS fixes disagree with the poses, by up to 100 m (\xef\xbf\xbd.jpg)"), 0u) << text;
  Georeference agreeing = fit();
  agreeing.residuals[1].isInlier = true;
  writeGeoreference(file_, agreeing, "", source());
  EXPECT_EQ(describeDisagreeing(readGeoreference(file_)), "");
  writeGeoreference(file_, std::nullopt, "2 photos with GPS; three are needed", source());
  EXPECT_EQ(describeDisagreeing(readGeoreference(file_)), "");
}

TEST_F(GeoreferenceJson, ReadsPosesThatAreAbsurdlyFarAway) {
  Georeference wild = fit();
  wild.residuals[1].metres = {1e12, -1e12, 0};
  wild.frame.enuFromWorld(1, 3) = 1e11;
  writeGeoreference(file_, wild, "", source());
  EXPECT_NEAR(readGeoreference(file_).residuals[1].metres.x(), 1e9, 2e7);
}

TEST_F(GeoreferenceJson, KeepsTheReasonWhyThereIsNone) {
  writeGeoreference(file_, std::nullopt, "2 photos with GPS; three are needed", source());
  EXPECT_EQ(readGeoreference(file_).reason, "2 photos with GPS; three are needed");
  EXPECT_TRUE(readGeoreference(file_).residuals.empty());
}

TEST_F(GeoreferenceJson, IsRefusedIfItIsDamaged) {
  writeGeoreference(file_, fit(), "", source());
  const auto whole = nlohmann::json::parse(readTextFile(file_));
  ASSERT_NO_THROW(readGeoreference(file_));
  const auto expectRefused = [&](const std::string& text) {
    writeFileAtomically(file_, text);
    try {
      readGeoreference(file_);
      ADD_FAILURE() << "was read: " << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.subject(), file_.string());
      EXPECT_EQ(error.remedy(), "remove it, and run again");
    }
  };
  const std::string text = whole.dump();
  for (const std::string& damaged :
       {std::string(), text.substr(0, text.size() / 2), std::string("[]"), std::string("3"),
        std::string("{\"reason\": \"\"}"), std::string("{\"reason\": 1}")})
    expectRefused(damaged);
  // Each part of the file, missing and of another kind.
  for (const auto& [key, value] : whole.items()) {
    if (key == "origin" || key == "enu_from_model") continue;  // for other programs
    auto damaged = whole;
    damaged[key] = "text";
    expectRefused(damaged.dump());
    damaged.erase(key);
    const bool isOptional =
        key == "bend" || key == "ignores_take_off" || key == "has_altitudes";  // earlier ones lack it
    if (!isOptional) expectRefused(damaged.dump());
  }
  for (const auto& [key, value] : whole["residuals"][0].items()) {
    auto damaged = whole;
    damaged["residuals"][0][key] = nlohmann::json::object();
    expectRefused(damaged.dump());
    damaged["residuals"][0].erase(key);
    expectRefused(damaged.dump());
  }
  for (const nlohmann::json& metres : {nlohmann::json{1, 2}, nlohmann::json{1, 2, 3, 4}, nlohmann::json{1, 2, 1e300}}) {
    auto damaged = whole;
    damaged["residuals"][0]["metres"] = metres;
    expectRefused(damaged.dump());
  }
  for (const int flight : {-1, 2}) {
    auto damaged = whole;
    damaged["residuals"][0]["flight"] = flight;
    expectRefused(damaged.dump());
  }
  auto damaged = whole;
  damaged["agreeing"] = 3;
  expectRefused(damaged.dump());
  damaged = whole;
  damaged["standard_errors"]["scale"] = -1;
  expectRefused(damaged.dump());
}

}  // namespace
}  // namespace tessera
