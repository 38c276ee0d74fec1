#include "representations/methods.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "bake/baker.h"
#include "base/error.h"
#include "base/testing/temporary_folder.h"
#include "representations/field/testing/trained_cube.h"
#include "representations/hash/testing/hash_cube.h"
#include "representations/list.h"
#include "representations/mesh/testing/small_mesh.h"
#include "representations/volume/testing/volume_cube.h"
#include "tiles/scene_folder.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

#define NAME(name, Name) #name,
#define SKIP(name, Name)
const std::vector<std::string> kNames = {TESSERA_REPRESENTATIONS(NAME, NAME)};
const std::vector<std::string> kNamesOfScenes = {TESSERA_REPRESENTATIONS(SKIP, NAME)};
#undef SKIP
#undef NAME

// Settings that train within seconds.
std::unique_ptr<MethodSettings> smallSettings(const Method& method) {
  if (method.name == "field") return std::make_unique<SettingsOf<FieldConfig>>(cubeConfig());
  if (method.name == "volume") return std::make_unique<SettingsOf<VolumeConfig>>(smallVolumeConfig());
  if (method.name == "hash") return std::make_unique<SettingsOf<HashConfig>>(smallHashConfig());
  if (method.name == "mesh") return std::make_unique<SettingsOf<MeshConfig>>(smallMeshConfig());
  ADD_FAILURE() << method.name << " has no settings for this test";
  return method.settings("");
}

// Changes the value of the field.
void change(const ConfigField& field) {
  if (const auto* flag = std::get_if<bool*>(&field.value)) **flag = !**flag;
  if (const auto* number = std::get_if<int*>(&field.value)) **number += 3;
  if (const auto* number = std::get_if<int64_t*>(&field.value)) **number += int64_t{1} << 40;
  if (const auto* number = std::get_if<double*>(&field.value)) **number = 0.7 * **number + 1.0 / 3;
  if (const auto* number = std::get_if<NumberOrAuto*>(&field.value)) {
    **number = **number ? NumberOrAuto() : NumberOrAuto(0.25);
  }
  if (const auto* text = std::get_if<std::string*>(&field.value)) **text += " \"quoted\"";
}

std::vector<std::string> settingTexts(MethodSettings& settings) {
  std::vector<std::string> texts;
  for (const ConfigField& field : settings.fields()) texts.push_back(configValueText(field));
  return texts;
}

TEST(Methods, AreThoseOfTheListInItsOrder) {
  std::vector<std::string> names;
  for (const Method* method : methods()) names.emplace_back(method->name);
  EXPECT_EQ(names, kNames);
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
  for (const Method* method : methods()) EXPECT_EQ(findMethod(method->name), method);
  EXPECT_EQ(findMethod("guess"), nullptr);
  EXPECT_EQ(findMethod(""), nullptr);
}

TEST(Methods, OfferWhatTheirRowOfTheListSays) {
  for (const Method* method : methods()) {
    EXPECT_FALSE(method->summary.empty()) << method->name;
    EXPECT_NE(method->settings, nullptr) << method->name;
    EXPECT_NE(method->train, nullptr) << method->name;
    EXPECT_NE(method->openModel, nullptr) << method->name;
    EXPECT_NE(method->describe, nullptr) << method->name;
    const bool isScene = std::count(kNamesOfScenes.begin(), kNamesOfScenes.end(), method->name) > 0;
    EXPECT_EQ(isBaked(*method), isScene) << method->name;
    EXPECT_TRUE(isScene || method->bakeParameters.empty()) << method->name;
    EXPECT_TRUE(method->trainsInBlocks || !method->swapsBlocks) << method->name;
    EXPECT_TRUE(method->trainsInBlocks || !method->partsAlone) << method->name;
    const std::vector<ConfigField> fields = method->settings("")->fields();
    const auto has = [&](std::string_view name) {
      return std::any_of(fields.begin(), fields.end(), [&](const ConfigField& field) { return field.name == name; });
    };
    EXPECT_TRUE(has("seed")) << method->name << ": --seed sets it";
    EXPECT_EQ(has("resident_blocks"), method->swapsBlocks) << method->name << ": --resident-blocks sets it";
    std::set<std::string_view> names;
    for (const ConfigField& field : fields) EXPECT_TRUE(names.insert(field.name).second) << field.name;
  }
}

TEST(Methods, ReadTheirSettingsBackFromConfigToml) {
  const TemporaryFolder folder;
  for (const Method* method : methods()) {
    const std::unique_ptr<MethodSettings> written = method->settings("");
    written->check();
    const std::vector<std::string> defaults = settingTexts(*written);
    for (const ConfigField& field : written->fields()) change(field);
    const fs::path model = folder / std::string(method->name);
    writeFileAtomically(ModelFolder(model).configPath(), configToToml(written->fields()));
    const std::vector<std::string> expected = settingTexts(*written),
                                   read = settingTexts(*savedSettings(*method, model));
    ASSERT_EQ(read.size(), defaults.size());
    for (size_t i = 0; i < read.size(); ++i) {
      EXPECT_EQ(read[i], expected[i]) << method->name;
      EXPECT_NE(read[i], defaults[i]) << method->name << ": nothing was changed";
    }
    EXPECT_EQ(settingTexts(*savedSettings(*method, folder / "nothing")), defaults);
  }
}

TEST(Methods, RejectUnknownPresets) {
  for (const Method* method : methods()) {
    const std::unique_ptr<MethodSettings> settings = method->settings("");
    const std::vector<ConfigField> fields = settings->fields();
    const auto preset =
        std::find_if(fields.begin(), fields.end(), [](const ConfigField& field) { return field.name == "preset"; });
    if (preset == fields.end()) continue;
    EXPECT_EQ(settingTexts(*method->settings(configValueText(*preset))), settingTexts(*settings)) << method->name;
    EXPECT_THROW(method->settings("guess"), Error) << method->name;
  }
}

TEST(Methods, GiveBakeParametersOfOneNameTheSameMeaning) {
  std::map<std::string_view, std::string_view> helps;
  for (const Method* method : methods()) {
    std::set<std::string_view> names;
    for (const BakeParameter& parameter : method->bakeParameters) {
      EXPECT_TRUE(names.insert(parameter.name).second) << parameter.name;
      EXPECT_EQ(helps.emplace(parameter.name, parameter.help).first->second, parameter.help) << parameter.name;
      EXPECT_LT(parameter.minimum, parameter.maximum) << parameter.name;
      const int64_t standard = parameter.standard.value_or(parameter.minimum);
      EXPECT_TRUE(parameter.minimum <= standard && standard <= parameter.maximum) << parameter.name;
      EXPECT_EQ(standard % parameter.divisibleBy, 0) << parameter.name;
    }
  }
}

TEST(Methods, AreNamedInSentences) {
  const auto all = [](const Method&) { return true; };
  EXPECT_EQ(namesOfMethods([](const Method&) { return false; }), "");
  EXPECT_EQ(namesOfMethods([](const Method& method) { return &method == methods().front(); }), kNames[0]);
  EXPECT_EQ(&firstMethod(all), methods().front());
  std::string expected;
  for (size_t i = 0; i < kNames.size(); ++i) {
    expected += (i == 0 ? "" : i + 1 < kNames.size() ? ", " : " or ") + kNames[i];
  }
  EXPECT_EQ(namesOfMethods(all, "or"), expected);
}

// Trains, describes, renders and bakes a model with every method.
TEST(Methods, TrainDescribeDrawAndBakeTheirModels) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  for (const Method* method : methods()) {
    const fs::path model = scene / std::string(method->name);
    BlockRunOptions options;
    options.blocks = *parseBlockCount("2x1");
    options.loop.steps = 6;  // enough for one step of the coarser level
    options.loop.progress = false;
    const std::unique_ptr<MethodSettings> settings = smallSettings(*method);
    EXPECT_TRUE(method->train(*device, scene.capture(), model, *settings, options).finished) << method->name;
    EXPECT_EQ(&findModelMethod(ModelFolder(model)), method);
    const auto numbers = method->describe(*savedSettings(*method, model));
    EXPECT_EQ(numbers, method->describe(*settings)) << method->name;
    EXPECT_NE(numbers, method->describe(*method->settings(""))) << method->name << ": other settings, another size";
    for (const auto& [what, number] : numbers) EXPECT_GT(number, 0u) << method->name << " " << what;

    const std::unique_ptr<OpenedModel> opened = method->openModel(*device, model);
    const Camera camera = scene.capture().cameras[0].scaledTo(8, 6);
    EXPECT_EQ(opened->renderer().render(camera, scene.capture().photos[0].worldFromCamera).colour.pixels.size(), 144u);
    EXPECT_EQ(opened->rayWork().samples > 0, method->countsSamples) << method->name;
    EXPECT_EQ(readCoverage(*method, model).empty(), method->readCoverage == nullptr) << method->name;

    if (!isBaked(*method)) continue;
    BakeParameters parameters;
    for (const BakeParameter& parameter : method->bakeParameters) {
      if (parameter.standard) parameters.emplace(parameter.name, *parameter.standard);
    }
    BakeOptions baking;
    baking.stride = 16;
    int64_t done = 0, all = 0;
    baking.onStep = [&](int64_t now, int64_t of) {
      EXPECT_EQ(now, ++done);
      all = of;
    };
    const std::unique_ptr<Baker> baker = method->openBaker(*device, model, parameters);
    const BakedScene baked = bakeScene(*baker, scene.capture(), model / "scene", baking);
    EXPECT_EQ(readTileset(model / "scene").representation, method->name);
    if (method->trainsInBlocks) {
      ASSERT_EQ(baked.levels.size(), 2u) << method->name << ": two blocks, and a tile that holds both";
      EXPECT_EQ(baked.tileset.tiles.size(), 3u);
    }
    EXPECT_EQ(done, all) << method->name;
    EXPECT_GT(done, 0) << method->name;
  }
}

TEST(Methods, RefuseToTrainWithSettingsThatTheirCheckRefuses) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  for (const Method* method : methods()) {
    const std::unique_ptr<MethodSettings> settings = method->settings("");
    const std::vector<ConfigField> fields = settings->fields();
    const auto wrong = std::find_if(fields.begin(), fields.end(), [](const ConfigField& field) {
      return field.bounds.isBounded && std::holds_alternative<double*>(field.value);
    });
    ASSERT_NE(wrong, fields.end()) << method->name;
    *std::get<double*>(wrong->value) = 2 * wrong->bounds.high + 1;
    const fs::path model = scene / std::string(method->name);
    BlockRunOptions options;
    options.loop.progress = false;
    try {
      method->train(*device, scene.capture(), model, *settings, options);
      ADD_FAILURE() << method->name << " trains with a wrong " << wrong->name;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(wrong->name), std::string::npos) << method->name << ": " << error.what();
    }
    EXPECT_FALSE(fs::exists(model)) << method->name;
  }
}

TEST(Methods, AreIdentifiedByTheManifest) {
  const CubeScene scene;
  const ModelFolder model(scene / "model");
  EXPECT_THROW(findModelMethod(model), Error) << "there is no manifest";
  ModelManifest manifest;
  manifest.method = "guess";
  try {
    findModelMethod(model, manifest);
    FAIL() << "the unknown method was accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("'guess' is not a method that this tessera knows"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace tessera
