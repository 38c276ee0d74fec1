#include "representations/field/train/config.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "base/error.h"

namespace tessera {
namespace {

// Changes a field of any type to a value other than its default.
void change(const ConfigField& field, int i) {
  std::visit(
      [i](auto* value) {
        using T = std::remove_pointer_t<decltype(value)>;
        if constexpr (std::is_same_v<T, bool>) {
          *value = !*value;
        } else if constexpr (std::is_same_v<T, std::string>) {
          *value += "-" + std::to_string(i);
        } else if constexpr (std::is_same_v<T, NumberOrAuto>) {
          *value = value->value_or(0) + i + 1.125;
        } else {
          *value += static_cast<T>(i) + static_cast<T>(1) + static_cast<T>(0.123456789);
        }
      },
      field.value);
}

TEST(FieldConfig, EveryFieldSurvivesItsFile) {
  FieldConfig written, defaults;
  std::vector<ConfigField> fields = written.fields();
  for (size_t i = 0; i < fields.size(); ++i) change(fields[i], static_cast<int>(i));
  const fs::path path = fs::temp_directory_path() / ("tessera_field_config_" + std::to_string(::getpid()) + ".toml");
  writeFileAtomically(path, configToToml(fields));
  FieldConfig read;
  configFromToml(read.fields(), path);
  fs::remove(path);
  const std::vector<ConfigField> again = read.fields(), before = defaults.fields();
  for (size_t i = 0; i < fields.size(); ++i) {
    EXPECT_EQ(configValueText(again[i]), configValueText(fields[i])) << fields[i].name;
    EXPECT_NE(configValueText(again[i]), configValueText(before[i])) << fields[i].name;
  }
}

TEST(FieldConfig, ShapesTheModelAndItsSpace) {
  FieldConfig config;
  config.gridLevels = 5;
  config.gridFeatures = 4;
  config.width = 32;
  config.densityHidden = 2;
  config.colourHidden = 3;
  config.contracted = false;
  config.occupancyResolution = 64;
  const RadianceFieldShape shape = config.shape();
  EXPECT_EQ(shape.grid.levels.size(), 5u);
  EXPECT_EQ(shape.density.inputs, 20);
  EXPECT_EQ(shape.density.width, 32);
  EXPECT_EQ(shape.density.hiddenLayers, 2);
  EXPECT_EQ(shape.colour.hiddenLayers, 3);
  EXPECT_EQ(shape.colour.inputs, shape.density.outputs + shape.harmonicsDegree * shape.harmonicsDegree);
  EXPECT_FALSE(config.space().contracted);
  EXPECT_EQ(config.space().gridResolution, 64);
}

TEST(FieldConfig, RefusesRaysOfTooManySteps) {
  FieldConfig config;
  config.cone = 0;
  EXPECT_NO_THROW(config.check());
  config.minStep = 0.001;
  EXPECT_THROW(config.check(), Error);
  config.far = 16;
  EXPECT_NO_THROW(config.check());
}

TEST(FieldConfig, NamesInvalidSettings) {
  EXPECT_NO_THROW(FieldConfig().check());
  for (const char* assignment : {"width=17",
                                 "grid_features=3",
                                 "grid_levels=0",
                                 "grid_levels=65",
                                 "grid_log2_size=60",
                                 "grid_base=0",
                                 "grid_finest=8",
                                 "occupancy_resolution=30",
                                 "occupancy_resolution=0",
                                 "samples_per_step=-5",
                                 "max_rays=0",
                                 "first_rays=1000000",
                                 "density_hidden=0",
                                 "colour_hidden=-1",
                                 "min_step=0",
                                 "min_step=nan",
                                 "samples_per_micro_batch=0",
                                 "depth_weight=-1",
                                 "depth_tolerance=2",
                                 "sparse_depth_ray_fraction=1.5",
                                 "full_gradient_distance=nan",
                                 "far=-1",
                                 "occupancy_every=0",
                                 "occupancy_update_fraction=2",
                                 "learning_rate=nan",
                                 "learning_rate=-1",
                                 "steps_per_photo=0",
                                 "photo_budget_mib=-1",
                                 "roi_margin=0",
                                 "distortion_weight=inf"}) {
    FieldConfig config;
    setConfigField(config.fields(), assignment);
    const std::string key = std::string(assignment).substr(0, std::string(assignment).find('='));
    try {
      config.check();
      ADD_FAILURE() << assignment;
    } catch (const Error& error) {
      EXPECT_NE(error.subject().find(key), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace tessera
