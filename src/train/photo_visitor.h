// Visits the pixels of training photos in batches, to find out what parts of a model they see: every n-th pixel of each
// photo that its mask does not exclude and, for the background block, of a margin around the photo.
#pragma once

#include <functional>
#include <span>

#include "train/image_rays.h"
#include "train/photo_visibility.h"

namespace tessera {

// Where the pixels of a batch lie.
enum class SeenThrough {
  photo,   // in the photo; all that they see is used
  margin,  // in the margin around it; only what they see of the background block is used
};

// Receives the visited pixels.
class PixelVisitor {
 public:
  virtual ~PixelVisitor() = default;
  // Starts a photo: all following pixels belong to it. Both references remain valid until the next call.
  virtual void begin(const Photo& photo, const Camera& camera) = 0;
  // `pixels`: [n][2], pixel centres, which may lie outside the photo.
  virtual void visit(std::span<const float> pixels, SeenThrough through) = 0;
};

// latticeWithin returns every `stride`-th pixel of a photo; latticeBeside returns a sparser lattice of the photo and
// its margin of kOutOfFrameMargin.
PixelLattice latticeWithin(const Camera& camera, int stride);
PixelLattice latticeBeside(const Camera& camera, int stride);

class PhotoVisitor {
 public:
  // Passes on batches of at most `maxBatchPixels` pixels. Keeps references to `capture` and `visitor`.
  PhotoVisitor(const Capture& capture, const SceneFrame& frame, uint32_t maxBatchPixels, PixelVisitor& visitor)
      : capture_(capture), pixels_(capture, frame), maxBatchPixels_(maxBatchPixels), visitor_(visitor) {}

  // Starts a photo. Throws Error if its mask cannot be read.
  void begin(int photo);
  // Visits the pixels of these lattices. With `onlyBeside`, pixels within the photo are skipped.
  void look(const std::vector<PixelLattice>& lattices, SeenThrough through, bool onlyBeside);

  struct Margin {
    bool isVisited = false;
    bool onlyBeside = true;  // else its lattice also covers the photo
  };
  // Visits all training photos one after another, each with its margin, and calls `onPhoto(done, all)` after each.
  void visitAll(int stride, const Margin& margin, const std::function<void(int64_t, int64_t)>& onPhoto);

 private:
  const Capture& capture_;
  BakePixelFilter pixels_;
  uint32_t maxBatchPixels_;
  PixelVisitor& visitor_;
};

}  // namespace tessera
