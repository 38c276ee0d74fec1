// Base class of bakers of methods that train a separate model for each level of detail.
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "bake/baker.h"
#include "base/check.h"

namespace tessera {

template <class Model>
class LevelBaker : public Baker {
 public:
  // Opens the model of a level, beginning with the finest (0). Only one model is open at a time.
  using Models = std::function<std::unique_ptr<Model>(uint32_t level)>;

  // Opens the finest model. `levels` is at least 1.
  LevelBaker(Models models, uint32_t levels) : models_(std::move(models)), levels_(levels), next_(models_(0)) {}

  SceneDescription description() const final {
    CHECK(next_ != nullptr);
    return describe(*next_);
  }

  void bake(const Capture& capture, const BakeOptions& options, ContentSink& sink) final {
    CHECK(next_ != nullptr);
    const int64_t photos = static_cast<int64_t>(capture.photosIn(Split::train).size());
    for (uint32_t level = 0; level < levels_; ++level) {
      BakeOptions ofLevel = options;
      ofLevel.onStep = [&](int64_t done, int64_t) { options.onStep(level * photos + done, levels_ * photos); };
      ofLevel.stride <<= level;  // texels are twice as large, so half as many rays per axis pass through each
      if (level > 0) next_ = models_(level);
      bakeLevel(*next_, level, capture, ofLevel, sink);
      next_.reset();
    }
  }

 protected:
  virtual SceneDescription describe(const Model& finest) const = 0;
  // Adds the contents of one level, from its model.
  virtual void bakeLevel(Model& model, uint32_t level, const Capture& capture, const BakeOptions& options,
                         ContentSink& sink) = 0;

 private:
  Models models_;
  uint32_t levels_;
  std::unique_ptr<Model> next_;  // the model to bake next
};

}  // namespace tessera
