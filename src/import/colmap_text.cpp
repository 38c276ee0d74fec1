// Decodes cameras.txt, images.txt and points3D.txt: fields are separated by spaces, '#' starts a comment line, and an
// image takes two lines.
#include <fmt/format.h>

#include <charconv>

#include "import/colmap_model.h"

namespace tessera {
namespace {

class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {}

  // Reads the next line unchanged. Returns false at the end.
  bool next(std::string_view& line) {
    if (text_.empty()) return false;
    const size_t end = text_.find('\n');
    line = text_.substr(0, end);
    text_.remove_prefix(end == text_.npos ? text_.size() : end + 1);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    ++number_;
    return true;
  }
  // Reads the next line that is neither blank nor a comment. Returns false at the end.
  bool nextRecord(std::string_view& line) {
    while (next(line)) {
      const size_t begin = line.find_first_not_of(" \t");
      if (begin != line.npos && line[begin] != '#') return true;
    }
    return false;
  }
  size_t number() const { return number_; }

 private:
  std::string_view text_;
  size_t number_ = 0;
};

class Words {
 public:
  explicit Words(std::string_view line) : line_(line) {}

  std::string_view word() {
    const size_t begin = line_.find_first_not_of(" \t");
    if (begin == line_.npos) {
      line_ = {};
      return {};
    }
    line_.remove_prefix(begin);
    const size_t length = std::min(line_.find_first_of(" \t"), line_.size());
    const std::string_view text = line_.substr(0, length);
    line_.remove_prefix(length);
    return text;
  }
  template <class T>
  bool number(T& value) {
    std::string_view text = word();
    if (!text.empty() && text[0] == '+') text.remove_prefix(1);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return !text.empty() && error == std::errc() && end == text.data() + text.size();
  }
  std::string_view rest() const {
    const size_t begin = line_.find_first_not_of(" \t"), end = line_.find_last_not_of(" \t");
    return begin == line_.npos ? std::string_view{} : line_.substr(begin, end - begin + 1);
  }
  bool atEnd() const { return rest().empty(); }

 private:
  std::string_view line_;
};

bool decodeCameras(std::string_view text, ColmapModel& model, std::string& reason) {
  Lines lines(text);
  for (std::string_view line; lines.nextRecord(line);) {
    Words words(line);
    uint32_t id = 0;
    const bool hasId = words.number(id);
    const std::string_view lens = words.word();
    uint64_t width = 0, height = 0;
    bool ok = hasId && words.number(width) && words.number(height);
    std::vector<double> parameters;
    while (ok && !words.atEnd() && parameters.size() < 32) ok = words.number(parameters.emplace_back());
    if (ok && !isColmapLens(lens)) {
      model.unusable[id] = lens;
      continue;
    }
    std::string why = "expected: id MODEL width height parameters";
    const auto camera = ok ? colmapCamera(lens, width, height, parameters, why) : std::nullopt;
    if (!camera) {
      reason = fmt::format("line {}: {}", lines.number(), why);
      return false;
    }
    model.cameras[id] = *camera;
  }
  return true;
}

bool decodeImages(std::string_view text, ColmapModel& model, std::string& reason) {
  Lines lines(text);
  for (std::string_view line; lines.nextRecord(line);) {
    Words words(line);
    ColmapModel::Image image;
    bool ok = words.number(image.id);
    for (double& q : image.quaternion) ok = ok && words.number(q);
    for (double& t : image.translation) ok = ok && words.number(t);
    ok = ok && words.number(image.camera);
    image.name = words.rest();  // names may contain spaces
    if (!ok || image.name.empty()) {
      reason = fmt::format("line {}: expected: id qw qx qy qz tx ty tz camera name", lines.number());
      return false;
    }
    std::string_view keypointLine;  // an image without keypoints is followed by an empty line
    lines.next(keypointLine);
    for (Words values(keypointLine); !values.atEnd();) {
      ColmapModel::Keypoint keypoint;
      int64_t point = 0;
      if (!values.number(keypoint.x) || !values.number(keypoint.y) || !values.number(point)) {
        reason = fmt::format("line {}: expected keypoints as: x y point", lines.number());
        return false;
      }
      keypoint.point = static_cast<uint64_t>(point);
      if (point >= 0) image.keypoints.push_back(keypoint);
    }
    model.images.push_back(std::move(image));
  }
  return true;
}

bool decodePoints(std::string_view text, ColmapModel& model, std::string& reason) {
  Lines lines(text);
  for (std::string_view line; lines.nextRecord(line);) {
    Words words(line);
    ColmapModel::Point point;
    bool ok = words.number(point.id);
    for (int axis = 0; axis < 3; ++axis) ok = ok && words.number(point.point.xInWorld[axis]);
    for (uint8_t& channel : point.point.colour) ok = ok && words.number(channel);
    double error = 0;
    if (!ok || !words.number(error)) {
      reason = fmt::format("line {}: expected: id x y z r g b error track", lines.number());
      return false;
    }
    point.point.error = error >= 0 && error < 1e30 ? static_cast<float>(error) : 0.0f;
    model.points.push_back(point);
  }
  return true;
}

}  // namespace

std::optional<ColmapModel> decodeColmapText(std::string_view cameras, std::string_view images, std::string_view points,
                                            std::string& reason) {
  ColmapModel model;
  if (!decodeCameras(cameras, model, reason)) {
    reason = "cameras.txt: " + reason;
  } else if (!decodeImages(images, model, reason)) {
    reason = "images.txt: " + reason;
  } else if (!decodePoints(points, model, reason)) {
    reason = "points3D.txt: " + reason;
  } else {
    return model;
  }
  return std::nullopt;
}

}  // namespace tessera
