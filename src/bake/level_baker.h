// Bakers of methods that train a model of its own for each level of detail.
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
  // Gives the model of a level, the finest (0) first. One is held at a time.
  using Models = std::function<std::unique_ptr<Model>(uint32_t level)>;

  // Opens the finest. `levels`: at least 1.
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
      ofLevel.onPhoto = [&](int64_t done, int64_t) { options.onPhoto(level * photos + done, levels_ * photos); };
      ofLevel.stride <<= level;  // as many rays through its larger texels
      if (level > 0) next_ = models_(level);
      bakeLevel(*next_, level, capture, ofLevel, sink);
      next_.reset();
    }
  }

 protected:
  virtual SceneDescription describe(const Model& finest) const = 0;
  // Adds the contents of a level, whose model this is.
  virtual void bakeLevel(Model& model, uint32_t level, const Capture& capture, const BakeOptions& options,
                         ContentSink& sink) = 0;

 private:
  Models models_;
  uint32_t levels_;
  std::unique_ptr<Model> next_;  // to be baked
};

}  // namespace tessera
