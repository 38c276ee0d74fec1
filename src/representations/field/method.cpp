#include "representations/field/method.h"

#include "representations/field/train/field_renderer.h"
#include "representations/field/train/step_benchmark.h"
#include "representations/field/train/train_field.h"

namespace tessera {
namespace {

TrainingResult train(Device& device, const Capture& capture, const fs::path& model, const MethodSettings& settings,
                     const BlockRunOptions& options) {
  return trainField(device, capture, model, {SettingsOf<FieldConfig>::in(settings), options.loop});
}

class OpenedField final : public ModelWithRenderer<FieldModel, FieldRenderer> {
 public:
  using ModelWithRenderer::ModelWithRenderer;
  RayWork rayWork() const override {
    return {renderer_->densitiesEvaluated(), renderer_->coloursEvaluated(), FieldRenderer::kMinTransmittance};
  }
  void cullUnseen(const Capture& capture, const CullOptions& options) override {
    renderer_->cullUnseen(capture, options);
  }
};

std::unique_ptr<OpenedModel> openModel(Device& device, const fs::path& folder) {
  auto model = loadFieldModel(device, folder);
  auto renderer = std::make_unique<FieldRenderer>(*model);
  return std::make_unique<OpenedField>(std::move(model), std::move(renderer));
}

std::vector<std::pair<std::string, uint64_t>> describe(const MethodSettings& settings) {
  const RadianceFieldShape shape = SettingsOf<FieldConfig>::in(settings).shape();
  return {{"parameters", shape.grid.parameters() + shape.density.parameters() + shape.colour.parameters()},
          {"multiply_accumulates_per_sample", densityMultiplyAccumulates(shape)},
          {"view_dependent_multiply_accumulates_per_sample", colourMultiplyAccumulates(shape)}};
}

}  // namespace

const Method& fieldMethod() {
  static const Method kMethod = {
      .name = "field",
      .summary = "one hash-grid radiance field of the whole capture, rendered as a model; quick, and never baked",
      .countsSamples = true,
      .settings = makeSettings<FieldConfig>,
      .train = train,
      .openModel = openModel,
      .describe = describe,
      .benchmarkStep = benchmarkFieldStep,
  };
  return kMethod;
}

}  // namespace tessera
