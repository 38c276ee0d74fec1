#include "pipeline/run_report.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/image_io.h"
#include "base/testing/temporary_folder.h"
#include "photogrammetry/photo_matches.h"
#include "pipeline/georeference_json.h"
#include "pipeline/left_out_json.h"

namespace tessera {
namespace {

using Json = nlohmann::json;

size_t countParts(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++count;
  return count;
}

// The folder of a run with four photos, which a test changes before it asks for the page.
class RunReport : public testing::Test {
 protected:
  RunReport() {
    input_.title = "Tom & <Jerry> \xff";
    input_.method = "volume";
    SourceCapture source;
    Georeference fit;
    fit.fixes = fit.inliers = 4;
    fit.rmsMetres = 0.5;
    fit.middleError = 0.25;
    fit.scaleError = 0.0125;
    fit.heightsTooHigh = {0};
    for (int i = 0; i < 4; ++i) {
      const std::string name = fmt::format("{}.jpg", i);
      writeJpeg(folder_ / ("photos/" + name), ImageU8(40, 20, 3));
      input_.photos.push_back({.name = name, .file = folder_ / ("photos/" + name)});
      Photo photo;
      photo.name = name;
      photo.worldFromCamera.translation = Vec3d(i, i % 2, 0);
      source.capture.photos.push_back(photo);
      fit.residuals.push_back({i, {0.1, 0.2, 0.3}, {0.3, 0.3, 0.3}, true});
    }
    source_ = source;
    fit_ = fit;
    writeGeoreference(out_ / "poses/georeference.json", fit, "", source);
    writeLeftOut(out_ / "poses/left_out.json", {});
    evaluation_ = {{"psnr", 20.325}, {"ssim", 0.53641}, {"exposure", "neutral"}, {"views", {1, 2, 3}}};
    writeFileAtomically(out_ / "eval.json", evaluation_.dump());
    writeFileAtomically(out_ / "evaluation.html", "page");
    writeFileAtomically(out_ / "scene/tiles/a", std::string(1500000, 'x'));
    const Json stage = {{"name", "map<ping>"},
                        {"finished", true},
                        {"seconds", 75},
                        {"peak_bytes", 2500000},
                        {"summary", "4 of 4 & more"}};
    Json begun = stage;
    begun["name"] = "report";
    begun["finished"] = false;
    writeFileAtomically(out_ / "run.json", Json{{"stages", {stage, begun}}}.dump());
  }

  std::string page() const { return runReport(out_, input_); }
  bool says(const std::string& text) const { return page().find(text) != std::string::npos; }

  TemporaryFolder folder_;
  fs::path out_ = folder_ / "out";
  RunReportInput input_;
  SourceCapture source_;
  Georeference fit_;
  Json evaluation_;
};

TEST_F(RunReport, SummarisesTheRun) {
  const std::string html = page();
  for (const char* part :
       {"<b>4</b><span class=\"quiet\">photos</span>", "<b>4</b><span class=\"quiet\">photos in the scene</span>",
        "<b>± 0.25 m</b>", "<b>20.32 dB</b><span class=\"quiet\">PSNR of 3 held-out photos</span>", "<b>0.5364</b>",
        "<b>volume</b>", "<b>1.5 MB</b>", "held-out photos: neutral, as they were rendered", "<td>1.25 %</td>",
        "4 of 4 GPS fixes agree", "href=\"evaluation.html\"", "None: all photos are in the scene",
        "<tr><td>map&lt;ping&gt;</td><td>1 min 15 s</td><td>2.5 MB</td><td>4 of 4 &amp; more</td></tr>"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_EQ(html.find("<td>report</td>"), std::string::npos) << "it is not finished";
  EXPECT_EQ(countParts(html, "<svg"), 2u);
  EXPECT_EQ(countParts(html, "src=\"data:image/jpeg;base64,/9j/"), 4u);
}

TEST_F(RunReport, NamesPhotosWhoseGpsDisagrees) {
  fit_.residuals[2].isInlier = false;
  fit_.residuals[2].metres = {40, 0, 0};
  fit_.inliers = 3;
  writeGeoreference(out_ / "poses/georeference.json", fit_, "", source_);
  EXPECT_TRUE(says("<li>1 of 4 GPS fixes disagree with the poses, by up to 40 m (2.jpg)"));
  EXPECT_FALSE(says("None: all photos"));
}

TEST_F(RunReport, StatesTheWarningsOfStages) {
  Json run = Json::parse(readTextFile(out_ / "run.json"));
  run["stages"][0]["warnings"] = {"no <plausible> lens", "more"};
  writeFileAtomically(out_ / "run.json", run.dump());
  EXPECT_TRUE(says("<li>2 warnings of stages"));
  EXPECT_FALSE(says("None: all photos"));
  EXPECT_TRUE(says("4 of 4 &amp; more<br><span class=\"quiet\">warning: no &lt;plausible&gt; lens</span><br>"));
}

TEST_F(RunReport, IsOneFileWithoutScripts) {
  const std::string html = page();
  for (const char* part : {"<script", "http:", "https:", "<link", "@import", " onclick"})
    EXPECT_EQ(html.find(part), std::string::npos) << part;
  EXPECT_EQ(countParts(html, "url("), countParts(html, "url(#"));
  EXPECT_EQ(countParts(html, "href="), 1u);
}

TEST_F(RunReport, EscapesNames) {
  input_.leftOut = {{"<i>\xff", "infra & red"}};
  writeLeftOut(out_ / "poses/left_out.json", {{"<u>\xff.jpg", "blurred"}});
  input_.photos[0].name = "<s>\xfe.jpg";
  const std::string html = page();
  const std::string replacement = "\xef\xbf\xbd";  // U+FFFD
  for (const std::string part : {"Tom &amp; &lt;Jerry&gt; ", "&lt;i&gt;", "&lt;u&gt;", "&lt;s&gt;"})
    EXPECT_NE(html.find(part + replacement), std::string::npos) << part;
  EXPECT_NE(html.find("infra &amp; red"), std::string::npos);
  EXPECT_EQ(html.find('\xff'), std::string::npos);
  EXPECT_EQ(html.find('\xfe'), std::string::npos);
  for (const char* tag : {"<i>", "<u>", "<s>", "<Jerry>"}) EXPECT_EQ(html.find(tag), std::string::npos) << tag;
}

TEST_F(RunReport, NamesPhotosThatAreLeftOutByReason) {
  input_.leftOut = {{"x.dng", "in another format"}, {"y.dng", "in another format"}};
  writeLeftOut(out_ / "poses/left_out.json", {{"3.jpg", "truncated"}, {"2.jpg", kOfAnotherModel}});
  const std::string html = page();
  EXPECT_NE(html.find("2 photos not used: in another format: <span class=\"quiet\">x.dng, y.dng<"), std::string::npos);
  EXPECT_NE(html.find("1 photo not in the scene: truncated: <span class=\"quiet\">3.jpg<"), std::string::npos);
  EXPECT_NE(html.find("several models, of which the scene shows the largest; 1 photo is in another: <span "
                      "class=\"quiet\">2.jpg<"),
            std::string::npos);
  EXPECT_EQ(countParts(html, "2.jpg<"), 2u) << "in the warning and below its picture";
  EXPECT_NE(html.find("<b>2</b><span class=\"quiet\">photos in the scene<"), std::string::npos);
  EXPECT_NE(html.find("photos, and 2 left out"), std::string::npos);
  EXPECT_EQ(html.find("all photos are in the scene"), std::string::npos);
}

TEST_F(RunReport, WarnsOfPosesThatBend) {
  EXPECT_FALSE(says("dome"));
  fit_.bend = Georeference::Bend{2, 0.1};
  writeGeoreference(out_ / "poses/georeference.json", fit_, "", source_);
  EXPECT_TRUE(says("form a dome"));
  fit_.bend->metres = -2;
  fit_.heightsTooHigh = {15.25};
  writeGeoreference(out_ / "poses/georeference.json", fit_, "", source_);
  EXPECT_TRUE(says("form a bowl"));
  EXPECT_TRUE(says("flight 1: +15.2 m"));
}

TEST_F(RunReport, DoesWithoutGps) {
  writeGeoreference(out_ / "poses/georeference.json", std::nullopt, "0 photos with GPS; three are needed", {});
  EXPECT_TRUE(says("<p>None: 0 photos with GPS; three are needed."));
  EXPECT_EQ(countParts(page(), "<svg"), 0u);
}

TEST_F(RunReport, DoesWithoutAnEvaluation) {
  // Those of an earlier run with photos that were held out.
  input_.hasEvaluation = false;
  for (const bool isThere : {true, false}) {
    if (!isThere) {
      fs::remove(out_ / "eval.json");
      fs::remove(out_ / "evaluation.html");
    }
    EXPECT_TRUE(says("no photo is held out"));
    EXPECT_FALSE(says("evaluation.html"));
    EXPECT_FALSE(says("20.32"));
    EXPECT_FALSE(says("neutral"));
  }
}

TEST_F(RunReport, ShowsAFewPhotosOfManyFromTheFirstToTheLast) {
  for (int i = 4; i < 50; ++i) {
    input_.photos.push_back(input_.photos[0]);
    input_.photos.back().name = fmt::format("{}.jpg", i);
  }
  const std::string html = page();
  EXPECT_EQ(countParts(html, "src=\"data:image/jpeg;base64,"), kThumbnails);
  EXPECT_NE(html.find("alt=\"0.jpg\""), std::string::npos);
  EXPECT_NE(html.find("alt=\"49.jpg\""), std::string::npos);
}

TEST_F(RunReport, TurnsPicturesUpright) {
  input_.photos.resize(1);
  EXPECT_TRUE(says("<img width=\"40\" height=\"20\""));
  input_.photos[0].tags.orientation = 6;
  EXPECT_TRUE(says("<img width=\"20\" height=\"40\""));
}

TEST_F(RunReport, RefusesDamagedFilesWithARemedy) {
  const auto expectError = [this](const char* name, const char* text, const char* remedy) {
    const std::string before = readTextFile(out_ / name);
    writeFileAtomically(out_ / name, text);
    try {
      page();
      ADD_FAILURE() << name << " was read: " << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.subject(), (out_ / name).string());
      EXPECT_EQ(error.remedy(), remedy);
    }
    writeFileAtomically(out_ / name, before);
  };
  expectError("poses/georeference.json", "{\"fixes\": 4}", "remove it, and run again");
  expectError("poses/left_out.json", "[1]", "remove it, and run again");
  for (const char* text :
       {"{", "[]", "{\"psnr\": 20}", "{\"psnr\": 1, \"ssim\": \"a\", \"exposure\": \"\", \"views\": []}",
        "{\"psnr\": 1, \"ssim\": 1, \"exposure\": 3, \"views\": []}"})
    expectError("eval.json", text, "run again with --from evaluate");
  EXPECT_NO_THROW(page());
  evaluation_["psnr"] = nullptr;
  writeFileAtomically(out_ / "eval.json", evaluation_.dump());
  EXPECT_TRUE(says("<b>– dB</b>")) << "it was not a number";
}

}  // namespace
}  // namespace tessera
