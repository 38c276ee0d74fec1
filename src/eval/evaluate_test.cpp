#include "eval/evaluate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/testing/shared_data.h"
#include "eval/psnr.h"
#include "eval/testing/fake_capture.h"

namespace tessera {
namespace {

TEST(Evaluate, GivesTheMaximumToARendererThatReturnsThePhotos) {
  FakeCapture fake("evaluate_perfect");
  std::vector<ImageF> pictures;
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    const ImageU8 image = fakePhoto(64, 48, pictures.size());
    fake.add(name, image, name[0] == 'b' ? Split::train : Split::test);
    pictures.push_back(toFloat(image));
  }
  FakeRenderer renderer(pictures);
  int calls = 0;
  EvaluateOptions options;
  options.onView = [&](const ViewResult& result, const ViewPictures& seen) {
    EXPECT_EQ(result.name, calls == 0 ? "a.png" : "c.png");
    EXPECT_EQ(seen.photo.pixels, seen.rendered.pixels);
    ++calls;
  };
  const EvaluationReport report = evaluate(renderer, fake.capture, options);
  EXPECT_EQ(calls, 2);
  ASSERT_EQ(report.views.size(), 2u);
  EXPECT_EQ(report.psnr, kMaximumPsnr);
  EXPECT_NEAR(report.ssim, 1.0, 1e-6);
  EXPECT_FALSE(report.lpips);
  EXPECT_FALSE(report.depth);
  EXPECT_EQ(report.device, "fake <device>");
}

TEST(Evaluate, ClampsAndCompositesOverTheBackground) {
  FakeCapture fake("evaluate_background");
  fake.add("a", ImageU8(64, 48, 3, 255));
  FakeRenderer renderer([](const Camera& camera, int) {
    RenderedView view{ImageF(camera.width, camera.height, 3, 0.25f), ImageF(camera.width, camera.height, 1, 0.5f),
                      ImageF(camera.width, camera.height, 1)};
    return view;
  });
  renderer.colourBehind = {0.25f, 0.25f, 0.25f};  // 0.25 + 0.5 · 0.25 = 0.375 against 1
  EXPECT_NEAR(evaluate(renderer, fake.capture, {}).psnr, -20 * std::log10(0.625), 1e-4);
  renderer.colourBehind = {9, 9, 9};  // clamped to the white of the photo
  EXPECT_EQ(evaluate(renderer, fake.capture, {}).psnr, kMaximumPsnr);
}

TEST(Evaluate, LaysTransparentPhotosOverTheSameBackground) {
  FakeCapture fake("evaluate_alpha");
  ImageU8 photo(128, 96, 4, 255);  // also twice the camera's size
  for (size_t p = 0; p < photo.pixelCount(); ++p) photo.pixels[4 * p + 3] = p % 2 == 0 ? 0 : 255;
  fake.add("a", photo);
  FakeRenderer renderer([](const Camera& camera, int) {
    RenderedView view{ImageF(camera.width, camera.height, 3, 0.5f), ImageF(camera.width, camera.height, 1, 0.5f),
                      ImageF(camera.width, camera.height, 1)};
    return view;
  });
  renderer.colourBehind = {0.2f, 0.4f, 0.6f};
  EXPECT_GT(evaluate(renderer, fake.capture, {}).psnr, 90);
}

TEST(Evaluate, IgnoresMaskedPixels) {
  FakeCapture fake("evaluate_mask");
  const ImageU8 photo = fakePhoto(64, 48, 1);
  Photo& added = fake.add("a", photo);
  added.mask = fake.capture.root / "mask.png";
  ImageU8 mask(128, 96, 1, 255);  // of another size than the photo
  ImageF rendered = toFloat(photo);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) mask.at(x, y)[0] = 0;
  }
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 15; ++x) rendered.at(x, y)[1] = 0.0f;
  }
  writePng(added.mask, mask);
  FakeRenderer renderer({rendered});
  const EvaluationReport report = evaluate(renderer, fake.capture, {});
  EXPECT_EQ(report.psnr, kMaximumPsnr);
  EXPECT_NEAR(report.ssim, 1.0, 1e-6);
  fake.capture.photos[0].mask.clear();
  EXPECT_LT(evaluate(renderer, fake.capture, {}).psnr, 30);
}

TEST(Evaluate, ComparesOnlyOpaquePixelsIfNothingIsShownOutside) {
  FakeCapture fake("evaluate_outside");
  const ImageU8 photo = fakePhoto(64, 48, 1);
  fake.add("a", photo);
  RenderedView view = {toFloat(photo), ImageF(64, 48, 1, 1.0f), ImageF(64, 48, 1, 2.0f)};
  for (int y = 0; y < 12; ++y) {
    for (int x = 0; x < 64; ++x) {
      view.opacity.at(x, y)[0] = 0.4f;
      for (int c = 0; c < 3; ++c) view.colour.at(x, y)[c] *= 0.2f;
    }
  }
  FakeRenderer renderer([&](const Camera&, int) { return view; });
  renderer.hasOutside = false;
  const EvaluationReport report = evaluate(renderer, fake.capture, {});
  EXPECT_EQ(report.psnr, kMaximumPsnr);
  EXPECT_NEAR(report.ssim, 1.0, 1e-6);
  EXPECT_EQ(report.compared, 0.75);
  EXPECT_EQ(report.views[0].compared, 0.75);
  renderer.hasOutside = true;
  const EvaluationReport whole = evaluate(renderer, fake.capture, {});
  EXPECT_LT(whole.psnr, 30);
  EXPECT_EQ(whole.compared, 1);
}

// As files of four channels often are.
TEST(Evaluate, TakesPhotosThatAreOpaqueEverywhereForThoseWithoutAlpha) {
  FakeCapture fake("evaluate_outside_opaque");
  fake.add("a", ImageU8(64, 48, 4, 255));
  RenderedView view = {ImageF(64, 48, 3, 0.5f), ImageF(64, 48, 1, 1.0f), ImageF(64, 48, 1, 2.0f)};
  for (int y = 0; y < 48; ++y)
    for (int x = 48; x < 64; ++x) view.opacity.at(x, y)[0] = 0;
  FakeRenderer renderer([&](const Camera&, int) { return view; });
  renderer.hasOutside = false;
  EXPECT_EQ(evaluate(renderer, fake.capture, {}).compared, 0.75);
  EvaluateOptions options;
  options.rightHalves = true;
  EXPECT_EQ(evaluate(renderer, fake.capture, options).compared, 0.5);
}

TEST(Evaluate, ComparesAllPixelsOfPhotosWithAlpha) {
  FakeCapture fake("evaluate_outside_alpha");
  ImageU8 photo(64, 48, 4, 255);
  for (size_t p = 0; p < 64 * 12; ++p) photo.pixels[4 * p + 3] = 0;
  fake.add("a", photo);
  FakeRenderer renderer([&](const Camera& camera, int) { return makeEmptyView(camera); });
  renderer.hasOutside = false;
  const EvaluationReport report = evaluate(renderer, fake.capture, {});
  EXPECT_EQ(report.compared, 1);
  EXPECT_LT(report.psnr, 10);
}

TEST(Evaluate, FitsAGainOnTheLeftHalfAndEvaluatesTheRightHalf) {
  FakeCapture fake("evaluate_gain");
  const ImageU8 photo = fakePhoto(64, 48, 1);
  fake.add("a", photo);
  ImageF dark = toFloat(photo);
  const float gain[3] = {1.25f, 0.8f, 2.0f};
  for (size_t i = 0; i < dark.pixels.size(); ++i) dark.pixels[i] /= gain[i % 3];
  FakeRenderer renderer({dark});
  EvaluateOptions options;
  EXPECT_LT(evaluate(renderer, fake.capture, options).psnr, 20);
  options.exposures = Exposures::fitted;
  const EvaluationReport report = evaluate(renderer, fake.capture, options);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(report.views[0].gain[c], gain[c], 1e-5);
  EXPECT_GT(report.psnr, 90);

  // The right half does not enter the fit, so its error remains.
  for (int y = 0; y < 48; ++y) {
    for (int x = 32; x < 64; ++x) {
      for (int c = 0; c < 3; ++c) dark.at(x, y)[c] *= 0.5f;
    }
  }
  FakeRenderer halfWrong({dark});
  const EvaluationReport second = evaluate(halfWrong, fake.capture, options);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(second.views[0].gain[c], gain[c], 1e-5);
  EXPECT_LT(second.psnr, 20);
  EXPECT_NE(toJson(second).find("fitted on the left half, judged on the right"), std::string::npos);
}

// As in training: the sky behind a transparent place is not brightened with it.
TEST(Evaluate, AppliesGainsToTheSceneAlone) {
  FakeCapture fake("evaluate_background");
  const ImageU8 photo = fakePhoto(64, 48, 1);
  fake.add("a", photo);
  const Eigen::Array3f background(0.5f, 0.25f, 0.75f);
  ImageF scene = toFloat(photo);
  // Half transparent: the photo shows twice the colour that was rendered, over half of the background.
  for (size_t i = 0; i < scene.pixels.size(); ++i)
    scene.pixels[i] = (scene.pixels[i] - 0.5f * background[static_cast<int>(i % 3)]) / 2;
  FakeRenderer renderer([&scene](const Camera& camera, int) {
    return RenderedView{scene, ImageF(camera.width, camera.height, 1, 0.5f),
                        ImageF(camera.width, camera.height, 1, 1.0f)};
  });
  renderer.colourBehind = background;
  EvaluateOptions options;
  options.exposures = Exposures::fitted;
  const EvaluationReport report = evaluate(renderer, fake.capture, options);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(report.views[0].gain[c], 2, 1e-4);
  EXPECT_GT(report.psnr, 90);
}

TEST(Evaluate, AppliesTheGainThatAPhotosExposurePredicts) {
  FakeCapture fake("evaluate_predicted");
  const ImageU8 photo = fakePhoto(64, 48, 1);
  fake.add("a", photo).exposure = 0.5;
  ImageF dark = toFloat(photo);
  const double gain[3] = {std::exp2(0.2), std::exp2(0.25), std::exp2(0.4)};
  for (size_t i = 0; i < dark.pixels.size(); ++i) dark.pixels[i] /= static_cast<float>(gain[i % 3]);
  FakeRenderer renderer({dark});
  EvaluateOptions options;
  options.exposures = Exposures::predicted;
  EXPECT_THROW(evaluate(renderer, fake.capture, options), Error);
  options.response = ExposureResponse{{0.4f, 0.4f, 0.8f}, {0, 0.05f, 0}};
  const EvaluationReport report = evaluate(renderer, fake.capture, options);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(report.views[0].gain[c], gain[c], 1e-5);
  EXPECT_GT(report.psnr, 90);
  EXPECT_NE(toJson(report).find("\"predicted from EXIF\""), std::string::npos);
  // A photo without these tags is compared as it is rendered.
  fake.add("b", photo);
  FakeRenderer both({dark, dark});
  EXPECT_EQ(describeExposures(evaluate(both, fake.capture, options)), "predicted from EXIF for 1 of 2 views");
}

TEST(Evaluate, ComparesTheRightHalvesAloneIfAskedTo) {
  FakeCapture fake("evaluate_right");
  const ImageU8 photo = fakePhoto(64, 48, 1);
  fake.add("a", photo);
  ImageF wrong = toFloat(photo);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 32; ++x)
      for (int c = 0; c < 3; ++c) wrong.at(x, y)[c] *= 0.5f;
  FakeRenderer renderer({wrong});
  EXPECT_LT(evaluate(renderer, fake.capture, {}).psnr, 25);
  EvaluateOptions options;
  options.rightHalves = true;
  const EvaluationReport report = evaluate(renderer, fake.capture, options);
  EXPECT_EQ(report.psnr, kMaximumPsnr);
  EXPECT_NE(toJson(report).find("neutral, judged on the right half"), std::string::npos);
}

TEST(Evaluate, MeasuresDepthWhereThePhotoHasIt) {
  FakeCapture fake("evaluate_depth");
  Photo& added = fake.add("a", fakePhoto(64, 48, 1));
  added.depth = fake.capture.root / "depth.exr";
  ImageF depth(64, 48, 1, 2.5f);
  depth.at(0, 0)[0] = 0;
  writeDepthExr(added.depth, depth);
  fake.add("b", fakePhoto(64, 48, 2));
  FakeRenderer renderer({toFloat(fakePhoto(64, 48, 1)), toFloat(fakePhoto(64, 48, 2))});  // renders depth 2
  const EvaluationReport report = evaluate(renderer, fake.capture, {});
  ASSERT_TRUE(report.depth);
  EXPECT_NEAR(report.depth->absoluteRelative, 0.2, 1e-6);
  EXPECT_NEAR(report.depth->rootMeanSquare, 0.5, 1e-6);
  EXPECT_EQ(report.depth->pixels, 64u * 48u - 1);
  EXPECT_FALSE(report.views[1].depth);
}

TEST(Evaluate, ReportsMissingPhotos) {
  FakeCapture fake("evaluate_errors");
  FakeRenderer renderer({ImageF(64, 48, 3)});
  EXPECT_THROW(evaluate(renderer, fake.capture, {}), Error);  // no photos
  fake.add("small", ImageU8(32, 24, 3));
  try {
    evaluate(renderer, fake.capture, {});
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(error.reason().find("32×24"), std::string::npos) << error.what();
  }
  fs::remove(fake.capture.photos[0].image);
  EXPECT_THROW(evaluate(renderer, fake.capture, {}), Error);
}

TEST(Evaluate, WritesTheImagesOfEachViewAndNothingOutsideTheFolder) {
  FakeCapture fake("evaluate_images");
  const ImageU8 photo = fakePhoto(64, 48, 1);
  fake.add("sub/a.jpg", photo);
  fake.add("sub/a.png", photo);
  FakeRenderer renderer({toFloat(photo), toFloat(photo)});
  EvaluateOptions options;
  options.imagesDir = fake.capture.root / "out";
  evaluate(renderer, fake.capture, options);
  EXPECT_EQ(readImage(options.imagesDir / "sub/a.png").image.pixels, photo.pixels);
  EXPECT_EQ(readImage(options.imagesDir / "sub/a.png.png").image.pixels, photo.pixels);
  EXPECT_EQ(readImage(options.imagesDir / "sub/a.error.png").image.width, 64);
  fake.capture.photos[0].name = "../../escaped.jpg";
  EXPECT_THROW(evaluate(renderer, fake.capture, options), Error);
}

TEST(Evaluate, WritesEveryDocumentedKeyAsJson) {
  FakeCapture fake("evaluate_json");
  const ImageU8 photo = fakePhoto(64, 48, 1);
  Photo& masked = fake.add("a \"quoted\" \xff name", photo);
  masked.mask = fake.capture.root / "mask.png";
  writePng(masked.mask, ImageU8(64, 48, 1, 0));  // all pixels are masked
  fake.add("b", photo);
  FakeRenderer renderer({toFloat(photo), toFloat(photo)});
  const auto json = nlohmann::json::parse(toJson(evaluate(renderer, fake.capture, {})));
  EXPECT_EQ(json["psnr"], kMaximumPsnr);  // the mean over the only view that has a PSNR
  EXPECT_TRUE(json["lpips"].is_null());
  EXPECT_TRUE(json["lpips_net"].is_null());
  EXPECT_TRUE(json["depth"].is_null());
  ASSERT_EQ(json["views"].size(), 2u);
  EXPECT_TRUE(json["views"][0]["psnr"].is_null());
  EXPECT_TRUE(json["views"][0]["ssim"].is_null());
  EXPECT_EQ(json["views"][1]["name"], "b");
  EXPECT_EQ(json["compared"], 0.5);
  EXPECT_EQ(json["views"][0]["compared"], 0);
  EXPECT_GE(json["seconds_per_frame"].get<double>(), 0.0);
  EXPECT_EQ(json["device"], "fake <device>");
  EXPECT_EQ(json["exposure"], "neutral");
  EXPECT_EQ(json["split"], "test");
  EXPECT_TRUE(json["units"].contains("psnr"));
}

TEST(Evaluate, ReportsLpipsWithWeights) {
  SKIP_WITHOUT_SHARED_DATA("lpips");
  FakeCapture fake("evaluate_lpips");
  const ImageU8 photo = fakePhoto(64, 48, 1);
  fake.add("a", photo);
  FakeRenderer renderer({toFloat(fakePhoto(64, 48, 2))});
  EvaluateOptions options;
  options.lpipsWeights = sharedData("lpips") / "squeeze.safetensors";
  const EvaluationReport report = evaluate(renderer, fake.capture, options);
  ASSERT_TRUE(report.lpips);
  EXPECT_GT(*report.lpips, 0.05);
  EXPECT_EQ(report.lpipsNet, "squeeze");
  FakeRenderer perfect({toFloat(photo)});
  EXPECT_EQ(*evaluate(perfect, fake.capture, options).lpips, 0.0);
  options.exposures = Exposures::fitted;  // the right half, 32 pixels wide, is still large enough
  EXPECT_TRUE(evaluate(perfect, fake.capture, options).lpips);
}

}  // namespace
}  // namespace tessera
