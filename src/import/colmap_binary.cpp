// Decodes cameras.bin, images.bin and points3D.bin, which are packed and little-endian.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "import/colmap_model.h"

namespace tessera {
namespace {

// Reads values in sequence. Once the bytes have ended, every further read fails.
class Cursor {
 public:
  explicit Cursor(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <class T>
  T take() {
    T value{};
    if (bytes_.size() - at_ < sizeof(T)) {
      ok_ = false;
      at_ = bytes_.size();
      return value;
    }
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  std::string takeString() {
    const auto* begin = reinterpret_cast<const char*>(bytes_.data()) + at_;
    const size_t left = bytes_.size() - at_;
    const auto* end = left > 0 ? static_cast<const char*>(std::memchr(begin, 0, left)) : nullptr;
    if (end == nullptr) {
      ok_ = false;
      return {};
    }
    at_ += static_cast<size_t>(end - begin) + 1;
    return {begin, end};
  }
  void skip(uint64_t bytes) {
    if (left() < bytes) ok_ = false;
    at_ += static_cast<size_t>(std::min<uint64_t>(bytes, left()));
  }
  uint64_t left() const { return bytes_.size() - at_; }
  size_t position() const { return at_; }
  bool ok() const { return ok_; }

 private:
  std::span<const std::byte> bytes_;
  size_t at_ = 0;
  bool ok_ = true;
};

// Reads a count of records of at least `bytesEach` bytes. Fails if the rest of the file is too short for them.
bool takeCount(Cursor& in, uint64_t bytesEach, uint64_t& count, const char* what, std::string& reason) {
  count = in.take<uint64_t>();
  if (in.ok() && count <= in.left() / bytesEach) return true;
  reason = in.ok() ? fmt::format("claims {} {}, more than its {} bytes can hold", count, what, in.left())
                   : "ends before its first count";
  return false;
}

bool decodeCameras(std::span<const std::byte> bytes, ColmapModel& model, std::string& reason) {
  Cursor in(bytes);
  uint64_t count = 0;
  if (!takeCount(in, 24, count, "cameras", reason)) return false;
  for (uint64_t i = 0; i < count; ++i) {
    const size_t begin = in.position();
    const auto id = in.take<uint32_t>();
    const auto lens = in.take<int32_t>();
    const auto width = in.take<uint64_t>(), height = in.take<uint64_t>();
    const int parameterCount = colmapParameterCount(lens);
    if (in.ok() && parameterCount < 0) {
      // Its number of parameters is unknown too, and so is the start of the next camera.
      reason = fmt::format("byte {}: lens model number {} is not known", begin, lens);
      return false;
    }
    std::array<double, 16> parameters{};
    for (int p = 0; p < parameterCount; ++p) parameters[static_cast<size_t>(p)] = in.take<double>();
    if (!in.ok()) {
      reason = fmt::format("ends within camera {} of {}", i + 1, count);
      return false;
    }
    if (const std::string_view unusable = colmapUnusableLens(lens); !unusable.empty()) {
      model.unusable[id] = unusable;
      continue;
    }
    std::string why;
    const auto camera =
        colmapCamera(lens, width, height, std::span(parameters).first(static_cast<size_t>(parameterCount)), why);
    if (!camera) {
      reason = fmt::format("byte {}: camera {}: {}", begin, id, why);
      return false;
    }
    model.cameras[id] = *camera;
  }
  return true;
}

bool decodeImages(std::span<const std::byte> bytes, ColmapModel& model, std::string& reason) {
  Cursor in(bytes);
  uint64_t count = 0;
  if (!takeCount(in, 73, count, "images", reason)) return false;
  for (uint64_t i = 0; i < count; ++i) {
    ColmapModel::Image image;
    image.id = in.take<uint32_t>();
    for (double& q : image.quaternion) q = in.take<double>();
    for (double& t : image.translation) t = in.take<double>();
    image.camera = in.take<uint32_t>();
    image.name = in.takeString();
    const auto keypoints = in.take<uint64_t>();
    if (!in.ok() || keypoints > in.left() / 24) {
      reason = fmt::format("ends within image {} of {}", i + 1, count);
      return false;
    }
    for (uint64_t k = 0; k < keypoints; ++k) {
      ColmapModel::Keypoint keypoint;
      keypoint.x = in.take<double>();
      keypoint.y = in.take<double>();
      keypoint.point = in.take<uint64_t>();
      if (keypoint.point != ~uint64_t{0}) image.keypoints.push_back(keypoint);
    }
    model.images.push_back(std::move(image));
  }
  return true;
}

bool decodePoints(std::span<const std::byte> bytes, ColmapModel& model, std::string& reason) {
  Cursor in(bytes);
  uint64_t count = 0;
  if (!takeCount(in, 51, count, "points", reason)) return false;
  for (uint64_t i = 0; i < count; ++i) {
    ColmapModel::Point point;
    point.id = in.take<uint64_t>();
    for (int axis = 0; axis < 3; ++axis) point.point.xInWorld[axis] = in.take<double>();
    for (uint8_t& channel : point.point.colour) channel = in.take<uint8_t>();
    const auto error = in.take<double>();
    point.point.error = error >= 0 && error < 1e30 ? static_cast<float>(error) : 0.0f;
    const auto track = in.take<uint64_t>();
    if (!in.ok() || track > in.left() / 8) {
      reason = fmt::format("ends within point {} of {}", i + 1, count);
      return false;
    }
    in.skip(track * 8);
    model.points.push_back(point);
  }
  return true;
}

}  // namespace

std::optional<ColmapModel> decodeColmapBinary(std::span<const std::byte> cameras, std::span<const std::byte> images,
                                              std::span<const std::byte> points, std::string& reason) {
  ColmapModel model;
  if (!decodeCameras(cameras, model, reason)) {
    reason = "cameras.bin: " + reason;
  } else if (!decodeImages(images, model, reason)) {
    reason = "images.bin: " + reason;
  } else if (!points.empty() && !decodePoints(points, model, reason)) {
    reason = "points3D.bin: " + reason;
  } else {
    return model;
  }
  return std::nullopt;
}

}  // namespace tessera
