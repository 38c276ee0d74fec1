#include "train/photo_visitor.h"

namespace tessera {

PixelLattice latticeWithin(const Camera& camera, int stride) {
  return {0, 0, camera.width, camera.height, stride};
}

PixelLattice latticeBeside(const Camera& camera, int stride) {
  const int x = static_cast<int>(kOutOfFrameMargin * camera.width),
            y = static_cast<int>(kOutOfFrameMargin * camera.height);
  return {-x, -y, camera.width + x, camera.height + y, kOutOfFrameStride * stride};
}

void PhotoVisitor::begin(int photo) {
  const Photo& begun = capture_.photos[photo];
  const Camera& camera = capture_.cameras[begun.camera];
  pixels_.begin(begun, camera);
  visitor_.begin(begun, camera);
}

void PhotoVisitor::look(const std::vector<PixelLattice>& lattices, SeenThrough through, bool onlyBeside) {
  std::vector<float> batch;
  for (const PixelLattice& lattice : lattices) {
    for (int y = lattice.firstY; y < lattice.endY; y += lattice.stride) {
      for (int x = lattice.firstX; x < lattice.endX; x += lattice.stride) {
        if ((onlyBeside && pixels_.within(x, y)) || !pixels_.count(x, y)) continue;
        batch.push_back(static_cast<float>(x) + 0.5f);
        batch.push_back(static_cast<float>(y) + 0.5f);
        if (batch.size() < size_t{2} * maxBatchPixels_) continue;
        visitor_.visit(batch, through);
        batch.clear();
      }
    }
  }
  if (!batch.empty()) visitor_.visit(batch, through);
}

void PhotoVisitor::visitAll(int stride, const Margin& margin, const std::function<void(int64_t, int64_t)>& onPhoto) {
  const std::vector<int> photos = capture_.photosIn(Split::train);
  int64_t done = 0;
  for (const int photo : photos) {
    const Camera& camera = capture_.cameras[capture_.photos[photo].camera];
    begin(photo);
    look({latticeWithin(camera, stride)}, SeenThrough::photo, false);
    if (margin.isVisited) look({latticeBeside(camera, stride)}, SeenThrough::margin, margin.onlyBeside);
    onPhoto(++done, static_cast<int64_t>(photos.size()));
  }
}

}  // namespace tessera
