#include "pipeline/run_report_figures.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <regex>

namespace tessera {
namespace {

using Residual = GeoreferenceFile::Residual;

size_t countMatches(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  return static_cast<size_t>(std::distance(std::sregex_iterator(text.begin(), text.end(), regex), {}));
}

// Photos in rows of ten, ten metres apart, all of which agree.
std::vector<Residual> survey(int photos) {
  std::vector<Residual> residuals;
  for (int i = 0; i < photos; ++i) {
    residuals.push_back({fmt::format("photo_{}.jpg", i), i * 3 / photos, Vec3d(10 * (i % 10), 10 * (i / 10), 50),
                         Vec3d(0.5 * std::sin(i), 0.5 * std::cos(i), 0.1 * std::sin(2 * i)), Vec3d(0.4, 0.4, 0.1),
                         true});
  }
  return residuals;
}

constexpr const char* kMark = "<path( class=\"outlier\")? d=\"[^\"]*\"><title>";
constexpr const char* kOutlier = "<path class=\"outlier\" d=\"[^\"]*\"><title>";

TEST(RunFigures, HaveOneMarkForEachPhoto) {
  for (const int photos : {1, 2, 30, 333}) {
    for (const SvgFigure& figure : {residualFigure(survey(photos)), planFigure(survey(photos))}) {
      EXPECT_EQ(countMatches(figure.svg, kMark), static_cast<size_t>(photos));
      EXPECT_EQ(countMatches(figure.svg, kOutlier), 0u);
      EXPECT_EQ(countMatches(figure.svg, "nan|inf"), 0u);
      EXPECT_EQ(figure.caption.find("Outlier"), std::string::npos);
    }
  }
}

TEST(RunFigures, MarkOutliersAndStayReadableBesideThem) {
  std::vector<Residual> residuals = survey(30);
  const std::string before = residualFigure(residuals).svg;
  residuals[7].metres = Vec3d(4000, 0, 900);
  residuals[7].isInlier = false;
  for (const SvgFigure& figure : {residualFigure(residuals), planFigure(residuals)}) {
    EXPECT_EQ(countMatches(figure.svg, kMark), 30u);
    EXPECT_EQ(countMatches(figure.svg, kOutlier), 1u);
    EXPECT_NE(figure.svg.find("photo_7.jpg: 4000.00 m horizontally, +900.00 m in height, outlier"), std::string::npos);
    EXPECT_NE(figure.caption.find("Outliers"), std::string::npos);
  }
  // The bar of a photo that agrees is as long as before.
  const std::regex bar("<path d=\"([^\"]*)\"><title>photo_3.jpg");
  std::smatch first, second;
  const std::string after = residualFigure(residuals).svg;
  ASSERT_TRUE(std::regex_search(before, first, bar));
  ASSERT_TRUE(std::regex_search(after, second, bar));
  EXPECT_EQ(first[1], second[1]);
}

TEST(RunFigures, ScaleBarsWithResiduals) {
  std::vector<Residual> residuals = survey(2);
  residuals[0].metres = Vec3d(3, 4, 2);
  residuals[1].metres = Vec3d(0, 2.5, -1);
  const std::string svg = residualFigure(residuals).svg;
  const std::regex bar("<path d=\"M[0-9.]+ ([0-9.]+)V([0-9.]+)M[0-9.]+ ([0-9.]+)V([0-9.]+)\"><title>photo_([01])");
  std::vector<std::array<double, 2>> lengths;
  for (std::sregex_iterator it(svg.begin(), svg.end(), bar), end; it != end; ++it)
    lengths.push_back({std::stod((*it)[1]) - std::stod((*it)[2]), std::stod((*it)[3]) - std::stod((*it)[4])});
  ASSERT_EQ(lengths.size(), 2u);
  EXPECT_GT(lengths[0][0], 100);
  EXPECT_NEAR(lengths[0][0], 2 * lengths[1][0], 0.3) << "5 m and 2.5 m";
  EXPECT_GT(lengths[0][1], 50) << "upwards";
  EXPECT_NEAR(lengths[0][1], -2 * lengths[1][1], 0.3) << "2 m and -1 m";
}

TEST(RunFigures, OrderPhotosByFlightAndName) {
  std::vector<Residual> residuals = survey(12);
  for (size_t i = 0; i < residuals.size(); ++i) residuals[i].flight = i % 2 == 0 ? 1 : 0;
  std::reverse(residuals.begin(), residuals.end());
  const std::string svg = residualFigure(residuals).svg;
  std::string order;
  const std::regex name("photo_([0-9]+)");
  for (std::sregex_iterator it(svg.begin(), svg.end(), name), end; it != end; ++it) order += (*it)[1].str() + " ";
  EXPECT_EQ(order, "1 3 5 7 9 11 0 2 4 6 8 10 ");
  EXPECT_NE(svg.find(">flight 1<"), std::string::npos);
  EXPECT_NE(svg.find(">flight 2<"), std::string::npos);
  EXPECT_EQ(residualFigure(survey(2)).svg.find(">flight 3<"), std::string::npos);
}

TEST(RunFigures, StateHowMuchArrowsAreExaggerated) {
  std::vector<Residual> residuals = survey(100);  // 90 m across
  for (Residual& residual : residuals) residual.metres = Vec3d(0.1, 0, 0);
  const SvgFigure small = planFigure(residuals);
  EXPECT_NE(small.caption.find("exaggerated 20 times"), std::string::npos) << small.caption;
  // 0.1 m · 20 of an arrow, beside 10 m from one photo to the next.
  const std::regex arrow("<path d=\"M([0-9.]+) ([0-9.]+)L([0-9.]+) ([0-9.]+)\"><title>photo_([01])\\.");
  std::vector<std::array<double, 3>> arrows;
  for (std::sregex_iterator it(small.svg.begin(), small.svg.end(), arrow), end; it != end; ++it) {
    arrows.push_back({std::stod((*it)[1]), std::stod((*it)[3]), std::stod((*it)[4])});
    EXPECT_EQ((*it)[2], (*it)[4]) << "eastwards";
  }
  ASSERT_EQ(arrows.size(), 2u);
  EXPECT_NEAR((arrows[0][1] - arrows[0][0]) / (arrows[1][0] - arrows[0][0]), 0.2, 0.02);
  for (Residual& residual : residuals) residual.metres = Vec3d(7, 0, 0);
  EXPECT_NE(planFigure(residuals).caption.find("true to scale"), std::string::npos);
}

TEST(RunFigures, EscapeNamesAndShortenThem) {
  std::vector<Residual> residuals = survey(3);
  residuals[0].photo = "<b> & \"c\".jpg";
  residuals[1].photo = "folder/" + std::string(300, 'x') + "/ä.jpg";
  for (const SvgFigure& figure : {residualFigure(residuals), planFigure(residuals)}) {
    EXPECT_NE(figure.svg.find("&lt;b&gt; &amp; &quot;c&quot;.jpg"), std::string::npos);
    EXPECT_EQ(figure.svg.find("<b>"), std::string::npos);
    EXPECT_EQ(figure.svg.find(std::string(61, 'x')), std::string::npos);
    EXPECT_NE(figure.svg.find("x/ä.jpg"), std::string::npos);
  }
}

TEST(RunFigures, OfThousandsOfPhotosStayBelowAMegabyte) {
  std::vector<Residual> residuals = survey(2000);
  for (Residual& residual : residuals) residual.photo = std::string(600, 'n') + residual.photo;
  EXPECT_LT(residualFigure(residuals).svg.size(), size_t{1000000});
  EXPECT_LT(planFigure(residuals).svg.size(), size_t{1000000});
}

}  // namespace
}  // namespace tessera
