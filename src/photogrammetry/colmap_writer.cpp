#include "photogrammetry/colmap_writer.h"

#include <algorithm>
#include <map>

namespace tessera {
namespace {

// Packed, little-endian values.
class BinaryRecords {
 public:
  template <class T>
  void add(T value) {
    const auto* begin = reinterpret_cast<const std::byte*>(&value);
    bytes_.insert(bytes_.end(), begin, begin + sizeof value);
  }
  void add(const std::string& text) {
    const auto* begin = reinterpret_cast<const std::byte*>(text.c_str());
    bytes_.insert(bytes_.end(), begin, begin + text.size() + 1);
  }
  const Bytes& bytes() const { return bytes_; }

 private:
  Bytes bytes_;
};

Bytes encodeCameras(const ColmapModel& model) {
  const std::map<uint32_t, Camera> cameras(model.cameras.begin(), model.cameras.end());
  BinaryRecords records;
  records.add(uint64_t{cameras.size()});
  for (const auto& [id, camera] : cameras) {
    records.add(id);
    records.add(static_cast<int32_t>(camera.lens));
    records.add(static_cast<uint64_t>(camera.width));
    records.add(static_cast<uint64_t>(camera.height));
    for (int i = 0; i < lensParameterCount(camera.lens); ++i) records.add(camera.parameters[static_cast<size_t>(i)]);
  }
  return records.bytes();
}

Bytes encodeImages(const ColmapModel& model) {
  BinaryRecords records;
  records.add(uint64_t{model.images.size()});
  for (const ColmapModel::Image& image : model.images) {
    records.add(image.id);
    for (const double q : image.quaternion) records.add(q);
    for (const double t : image.translation) records.add(t);
    records.add(image.camera);
    records.add(image.name);
    records.add(uint64_t{image.keypoints.size()});
    for (const ColmapModel::Keypoint& keypoint : image.keypoints) {
      records.add(keypoint.x);
      records.add(keypoint.y);
      records.add(keypoint.point);
    }
  }
  return records.bytes();
}

Bytes encodePoints(const ColmapModel& model) {
  struct Sighting {
    uint32_t image, keypoint;
  };
  std::unordered_map<uint64_t, std::vector<Sighting>> tracks;
  for (const ColmapModel::Image& image : model.images)
    for (size_t k = 0; k < image.keypoints.size(); ++k)
      tracks[image.keypoints[k].point].push_back({image.id, static_cast<uint32_t>(k)});
  BinaryRecords records;
  records.add(uint64_t{model.points.size()});
  for (const ColmapModel::Point& point : model.points) {
    records.add(point.id);
    for (int axis = 0; axis < 3; ++axis) records.add(point.point.xInWorld[axis]);
    for (const uint8_t channel : point.point.colour) records.add(channel);
    records.add(static_cast<double>(point.point.error));
    const std::vector<Sighting>& track = tracks[point.id];
    records.add(uint64_t{track.size()});
    for (const Sighting& sighting : track) {
      records.add(sighting.image);
      records.add(sighting.keypoint);
    }
  }
  return records.bytes();
}

}  // namespace

void writeColmapModel(const ColmapModel& model, const fs::path& folder) {
  writeFileAtomically(folder / "cameras.bin", encodeCameras(model));
  writeFileAtomically(folder / "images.bin", encodeImages(model));
  writeFileAtomically(folder / "points3D.bin", encodePoints(model));
}

}  // namespace tessera
