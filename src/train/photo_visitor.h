// Looks through training photos' pixels, a batch at a time, to find out what of a model they see: every so manieth
// pixel of each photo that its mask does not leave out, and, for what lies around a scene, of a margin beside it.
#pragma once

#include <functional>
#include <span>

#include "train/photo_sight.h"
#include "train/picture_rays.h"

namespace tessera {

// Of which what is seen counts.
enum class SeenThrough {
  photo,   // pixels of the photo, which see all of a scene
  margin,  // what lies beside it, which sees only the scene's surround
};

// What is done with pixels.
class PixelVisitor {
 public:
  virtual ~PixelVisitor() = default;
  // All that follow are of this photo. Both stay.
  virtual void begin(const Photo& photo, const Camera& camera) = 0;
  // `pixels`: [n][2], their middles, which may lie beside the photo.
  virtual void visit(std::span<const float> pixels, SeenThrough through) = 0;
};

// Every `stride`-th pixel of a photo, and fewer of what is as far as kBesidePhotos beside it, the photo itself
// included.
PixelLattice latticeWithin(const Camera& camera, int stride);
PixelLattice latticeBeside(const Camera& camera, int stride);

class PhotoVisitor {
 public:
  // Batches of at most `mostPixels`. Keeps references to `capture` and `visitor`.
  PhotoVisitor(const Capture& capture, const SceneFrame& frame, uint32_t mostPixels, PixelVisitor& visitor)
      : capture_(capture), pixels_(capture, frame), mostPixels_(mostPixels), visitor_(visitor) {}

  // Throws Error when the photo's mask cannot be read.
  void begin(int photo);
  // Pixels of these lattices; with `onlyBeside` none that lie within the photo.
  void look(const std::vector<PixelLattice>& lattices, SeenThrough through, bool onlyBeside);

  struct Margin {
    bool isVisited = false;
    bool onlyBeside = true;  // else its lattice goes on within the photo
  };
  // All training photos one after another, each with its margin; `onPhoto(done, all)` after each.
  void visitAll(int stride, const Margin& margin, const std::function<void(int64_t, int64_t)>& onPhoto);

 private:
  const Capture& capture_;
  PhotoPixels pixels_;
  uint32_t mostPixels_;
  PixelVisitor& visitor_;
};

}  // namespace tessera
