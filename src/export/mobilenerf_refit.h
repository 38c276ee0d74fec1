// The network that MobileNeRF's viewer evaluates for each pixel, fitted to the decoders of a scene of `mesh`.
//
// The viewer has one network for everything: eight features of a texel, in bytes, and a direction → 16 → 16 → 3. A
// scene has a decoder for each block, whose inputs are features in ranges of their own and spherical harmonics. So two
// kinds of networks are trained together, on pairs of a texel and a direction with the colour that its decoder gives:
// the viewer's network, and one encoder for each decoder, which turns a texel's features into the viewer's. Bytes are
// rounded in training as they are in files; gradients pass through the rounding unchanged.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "base/threads.h"
#include "compute/device.h"
#include "representations/mesh/content/mesh_content.h"

namespace tessera {

inline constexpr uint32_t kViewerFeatures = 8;
inline constexpr uint32_t kViewerInputs = kViewerFeatures + 3;  // of the viewer's network: with the direction

// The byte of a feature from 0 to 1, and what the viewer reads from it. Features 3 and 7 are stored as alpha, of which
// the viewer takes the upper half alone: 128 + k stands for (2 k + 1) / 255. Feature 0 is never 0, which would make the
// texel transparent.
uint8_t encodeViewerFeature(uint32_t feature, float value);
float decodeViewerFeature(uint32_t feature, uint8_t byte);

// A texel with the directions from which it is seen, as unit vectors from the camera to the texel in scene axes.
struct RefitTexel {
  static constexpr size_t kDirections = 8;

  std::array<float, kMeshFeatures> features{};
  std::array<std::array<float, 3>, kDirections> directions{};
  std::array<float, kDirections> weights{};  // how much each direction counts
};

struct RefitError {
  double rms = 0;   // of colours from 0 to 1, over the channels of texels and directions that training left out
  double psnr = 0;  // the same in dB
  uint64_t colours = 0;
};

class ViewerRefit {
 public:
  explicit ViewerRefit(int threads);  // 0: as many as the machine has
  ~ViewerRefit();

  // Returns the number of a decoder, which it has from the first call with it on.
  uint32_t numberDecoder(const std::vector<DenseLayer>& decoder);
  // Adds a texel of a decoder. Of all that are added, a random choice is kept, of about equally many for each decoder.
  void add(uint32_t decoder, const RefitTexel& texel);
  uint32_t decoders() const;

  // Trains on the texels, which are then gone. CHECKs that there are some. Returns the error on every eighth texel,
  // which is not trained on. The result depends on the texels and their order, and not on the number of threads.
  RefitError train(int steps);

  // Returns the bytes of texels of a decoder, [texels][kViewerFeatures], from their features, [texels][kMeshFeatures].
  std::vector<uint8_t> encode(uint32_t decoder, std::span<const float> features);
  // The layers of the viewer's network: 11 → 16 → 16 → 3; a sigmoid follows the last.
  std::vector<DenseLayer> network() const;

 private:
  struct Weights;
  struct Encoder;
  struct Batch;

  void begin();
  void step(Batch& batch, int number, int steps);
  void fill(Batch& batch, int number);
  RefitError judge();

  ThreadPool pool_;
  std::unique_ptr<Device> device_;
  std::vector<std::unique_ptr<Encoder>> encoders_;  // by the number of the decoder
  std::unique_ptr<Weights> viewer_;
  uint64_t added_ = 0;
};

}  // namespace tessera
