#include "eval/report.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>

#include "eval/html.h"
#include "eval/testing/fake_capture.h"

namespace tessera {
namespace {

size_t countOccurrences(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++count;
  return count;
}

struct Judged {
  EvaluationReport report;
  std::string html;
};

Judged judge(const std::vector<std::string>& names, bool withDepth = false) {
  FakeCapture fake("report");
  std::vector<ImageF> pictures;
  for (const std::string& name : names) {
    const ImageU8 photo = fakePhoto(64, 48, pictures.size());
    Photo& added = fake.add(name, photo);
    if (withDepth) {
      added.depth = fake.capture.root / "depth.exr";
      writeDepthExr(added.depth, ImageF(64, 48, 1, 2.2f));
    }
    pictures.push_back(toFloat(photo));
    for (float& value : pictures.back().pixels)
      value += 0.05f * static_cast<float>(pictures.size());  // errors increase from view to view
  }
  FakeRenderer renderer(pictures);
  ReportBuilder builder("Tom & <Jerry>", names.size());
  EvaluateOptions options;
  options.onView = [&](const ViewResult& result, const ViewPictures& seen) { builder.add(result, seen); };
  Judged judged{evaluate(renderer, fake.capture, options), {}};
  judged.html = builder.html(judged.report);
  return judged;
}

TEST(Report, ContainsEveryViewWithItsFourImages) {
  const Judged judged = judge({"one.png", "two.png", "three.png"});
  for (const char* name : {"one.png", "two.png", "three.png"}) {
    EXPECT_EQ(countOccurrences(judged.html, std::string("<h3>") + name + "</h3>"), 1u) << name;
  }
  EXPECT_EQ(countOccurrences(judged.html, "<img "), 12u);
  EXPECT_EQ(countOccurrences(judged.html, "src=\"data:image/jpeg;base64,/9j/"), 12u);
  EXPECT_NE(judged.html.find(fmt::format("{:.2f} dB", judged.report.psnr)), std::string::npos);
}

TEST(Report, ShowsPhotosAsPeopleLookAtThem) {
  FakeCapture fake("turned");
  const ImageU8 photo = fakePhoto(64, 48, 0);
  fake.add("portrait.png", photo).orientation = 6;
  FakeRenderer renderer({toFloat(photo)});
  ReportBuilder builder("turned", 1);
  EvaluateOptions options;
  options.onView = [&](const ViewResult& result, const ViewPictures& seen) { builder.add(result, seen); };
  const EvaluationReport report = evaluate(renderer, fake.capture, options);
  EXPECT_EQ(countOccurrences(builder.html(report), "<img width=\"48\" height=\"64\""), 4u);
}

TEST(Report, CountsHolesOfPartsWhereTheyWereChecked) {
  Judged judged = judge({"one.png"});
  EXPECT_EQ(judged.html.find("Coverage"), std::string::npos);
  EXPECT_EQ(toJson(judged.report).find("coverage"), std::string::npos);
  judged.report.coverage = {{"block_<0>_0", 1000, 3}, {"block_1_0", 1000, 0}};
  const std::string html = ReportBuilder("title", 1).html(judged.report);
  EXPECT_NE(html.find("<tr><td>block_&lt;0&gt;_0</td><td>1000</td><td>3</td><td>0.300 %</td></tr>"), std::string::npos);
  EXPECT_NE(html.find("<tr><td>block_1_0</td><td>1000</td><td>0</td><td>0.000 %</td></tr>"), std::string::npos);
  EXPECT_NE(html.find("<b>0.150 %</b>"), std::string::npos) << "of all parts together";
  const auto json = nlohmann::json::parse(toJson(judged.report));
  EXPECT_EQ(json["coverage"][0], (nlohmann::json{{"part", "block_<0>_0"}, {"pixels", 1000}, {"holes", 3}}));
  EXPECT_EQ(json["coverage"].size(), 2u);
}

TEST(Report, PutsTheWorstViewFirst) {
  const std::string html = judge({"good", "bad", "ugly"}).html;
  const std::string table = html.substr(html.find("<table>"));
  EXPECT_LT(table.find(">ugly<"), table.find(">bad<"));
  EXPECT_LT(table.find(">bad<"), table.find(">good<"));
}

TEST(Report, EscapesAllNames) {
  const std::string name = "<script>alert(\"1\")</script>&'.jpg";
  const std::string html = judge({name, "b"}).html;
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("<Jerry>"), std::string::npos);
  EXPECT_EQ(html.find("<device>"), std::string::npos);
  EXPECT_NE(html.find("&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt;&amp;&#39;.jpg"), std::string::npos);
  EXPECT_NE(html.find("Tom &amp; &lt;Jerry&gt;"), std::string::npos);
}

TEST(Report, ReferencesNothingOutsideTheFile) {
  const std::string html = judge({"a", "b"}, true).html;
  EXPECT_EQ(html.find("http:"), std::string::npos);
  EXPECT_EQ(html.find("https:"), std::string::npos);
  EXPECT_EQ(html.find("url("), std::string::npos);
  EXPECT_EQ(countOccurrences(html, "<link"), 0u);
  EXPECT_EQ(countOccurrences(html, "depth, measured</figcaption>"), 2u);
}

TEST(Report, ShrinksItsImagesWhenThereAreManyViews) {
  const ImageF large(2000, 1000, 3, 0.5f);
  const RenderedView view{large, ImageF(2000, 1000, 1, 1.0f), ImageF(2000, 1000, 1, 3.0f)};
  ViewResult result;
  result.name = "x";
  EvaluationReport report;
  report.views = {result};
  size_t before = SIZE_MAX;
  for (const size_t views : {size_t{5}, size_t{50}, size_t{200}, size_t{2000}}) {
    ReportBuilder builder("t", views);
    builder.add(result, {large, large, view, nullptr, nullptr});
    const size_t bytes = builder.html(report).size();
    EXPECT_LT(bytes, before);
    before = bytes;
  }
  EXPECT_LT(before, 40000u);
}

TEST(Report, ShowsViewsWithoutNumbersOrImages) {
  EvaluationReport report;
  report.views.resize(2);
  report.views[0].name = "a";
  report.views[0].psnr = std::nan("");
  report.views[1].name = "b";
  report.views[1].psnr = 20;
  report.psnr = std::nan("");
  const std::string html = ReportBuilder("t", 2).html(report);
  EXPECT_EQ(html.find("nan"), std::string::npos);
  EXPECT_LT(html.find("<h3>b</h3>"), html.find("<h3>a</h3>"));
}

TEST(Html, EscapesWhatIsNotTextOfAPage) {
  EXPECT_EQ(escapedHtml("<a href=\"b\">'&'"), "&lt;a href=&quot;b&quot;&gt;&#39;&amp;&#39;");
  EXPECT_EQ(escapedHtml("a\n\tb"), "a  b");
  EXPECT_EQ(escapedHtml("ä…"), "ä…");
  EXPECT_EQ(escapedHtml("a\xff<"), "a\xef\xbf\xbd&lt;") << "not UTF-8";
}

TEST(Html, EncodesBase64WithItsPadding) {
  const auto encoded = [](std::string_view text) { return base64(std::as_bytes(std::span(text.data(), text.size()))); };
  EXPECT_EQ(encoded(""), "");
  EXPECT_EQ(encoded("f"), "Zg==");
  EXPECT_EQ(encoded("fo"), "Zm8=");
  EXPECT_EQ(encoded("foo"), "Zm9v");
  EXPECT_EQ(encoded("\xff\xfe\xfd\xfc"), "//79/A==");
}

}  // namespace
}  // namespace tessera
