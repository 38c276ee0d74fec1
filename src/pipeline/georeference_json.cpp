#include "pipeline/georeference_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "import/clean.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kFarthest = 1e9;  // metres; figures are drawn to this scale

// What is farther away, of a pose that is wrong, counts as this far.
Json metresToJson(const Vec3d& metres) {
  const Vec3d x = metres.cwiseMax(-0.99 * kFarthest).cwiseMin(0.99 * kFarthest);
  return {x.x(), x.y(), x.z()};
}

Json toJson(const Georeference& fit, const SourceCapture& source) {
  Json residuals = Json::array();
  for (const Georeference::Residual& residual : fit.residuals) {
    const auto index = static_cast<size_t>(residual.photo);
    const Photo& photo = source.capture.photos[index];
    const Vec3d position = (fit.frame.enuFromWorld * photo.worldFromCamera.translation.homogeneous()).head<3>();
    residuals.push_back({{"photo", photo.name},
                         {"flight", source.flight.empty() ? 0 : source.flight[index]},
                         {"position", metresToJson(position)},
                         {"metres", metresToJson(residual.metres)},
                         {"predicted", metresToJson(residual.predicted)},
                         {"agrees", residual.isInlier}});
  }
  Json matrix = Json::array();
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) matrix.push_back(fit.frame.enuFromWorld(row, column));
  Json json = {
      {"origin",
       {{"latitude", fit.frame.latitude}, {"longitude", fit.frame.longitude}, {"altitude", fit.frame.altitude}}},
      {"enu_from_model", std::move(matrix)},
      {"has_altitudes", fit.hasAltitudes},
      {"ignores_take_off", fit.ignoresTakeOff},
      {"fixes", fit.fixes},
      {"agreeing", fit.inliers},
      {"rms_metres", fit.rmsMetres},
      {"deviation_metres", {{"horizontal", fit.horizontalDeviation}, {"vertical", fit.verticalDeviation}}},
      {"standard_errors",
       {{"scale", fit.scaleError}, {"rotation_degrees", fit.rotationError}, {"middle_metres", fit.middleError}}},
      {"flights_too_high_metres", fit.heightsTooHigh},
      {"residuals", std::move(residuals)}};
  if (fit.bend)
    json["bend"] = {{"metres", fit.bend->metres}, {"error", fit.bend->error}, {"significant", fit.isBent()}};
  return json;
}

// What a damaged file makes readers of its parts throw.
struct Damaged {};

const Json& member(const Json& object, const char* key) {
  if (!object.is_object() || !object.contains(key)) throw Damaged();
  return object[key];
}

const Json& arrayMember(const Json& object, const char* key) {
  const Json& array = member(object, key);
  if (!array.is_array()) throw Damaged();
  return array;
}

double toNumber(const Json& value) {
  if (!value.is_number() || !(std::abs(value.get<double>()) < kFarthest)) throw Damaged();
  return value.get<double>();
}

// A standard error or a deviation.
double toSpread(const Json& value) {
  const double spread = toNumber(value);
  if (spread < 0) throw Damaged();
  return spread;
}

int toCount(const Json& value) {
  if (!value.is_number_integer() || toSpread(value) > 1e8) throw Damaged();
  return value.get<int>();
}

bool toBool(const Json& value) {
  if (!value.is_boolean()) throw Damaged();
  return value.get<bool>();
}

std::string toText(const Json& value) {
  if (!value.is_string()) throw Damaged();
  return value.get<std::string>();
}

Vec3d toMetres(const Json& value) {
  if (!value.is_array() || value.size() != 3) throw Damaged();
  return {toNumber(value[0]), toNumber(value[1]), toNumber(value[2])};
}

GeoreferenceFile parseGeoreference(const Json& json) {
  GeoreferenceFile parsed;
  if (json.is_object() && json.contains("reason")) {
    parsed.reason = toText(json["reason"]);
    if (parsed.reason.empty()) throw Damaged();
    return parsed;
  }
  // Earlier ones lack these.
  if (json.contains("has_altitudes")) parsed.hasAltitudes = toBool(json["has_altitudes"]);
  if (json.contains("ignores_take_off")) parsed.ignoresTakeOff = toBool(json["ignores_take_off"]);
  parsed.fixes = toCount(member(json, "fixes"));
  parsed.inliers = toCount(member(json, "agreeing"));
  if (parsed.inliers > parsed.fixes) throw Damaged();
  parsed.rmsMetres = toSpread(member(json, "rms_metres"));
  const Json& deviations = member(json, "deviation_metres");
  parsed.horizontalDeviation = toSpread(member(deviations, "horizontal"));
  parsed.verticalDeviation = toSpread(member(deviations, "vertical"));
  const Json& errors = member(json, "standard_errors");
  parsed.scaleError = toSpread(member(errors, "scale"));
  parsed.rotationError = toSpread(member(errors, "rotation_degrees"));
  parsed.middleError = toSpread(member(errors, "middle_metres"));
  for (const Json& height : arrayMember(json, "flights_too_high_metres"))
    parsed.heightsTooHigh.push_back(toNumber(height));
  if (json.contains("bend")) {
    const Json& bend = json["bend"];
    parsed.bend = Georeference::Bend{toNumber(member(bend, "metres")), toSpread(member(bend, "error"))};
    parsed.isBent = toBool(member(bend, "significant"));
  }
  for (const Json& entry : arrayMember(json, "residuals")) {
    GeoreferenceFile::Residual residual;
    residual.photo = toText(member(entry, "photo"));
    residual.flight = toCount(member(entry, "flight"));
    residual.position = toMetres(member(entry, "position"));
    residual.metres = toMetres(member(entry, "metres"));
    residual.predicted = toMetres(member(entry, "predicted"));
    residual.isInlier = toBool(member(entry, "agrees"));
    const bool isFlight = static_cast<size_t>(residual.flight) < parsed.heightsTooHigh.size();
    if (!isFlight || residual.predicted.minCoeff() < 0) throw Damaged();
    parsed.residuals.push_back(std::move(residual));
  }
  if (parsed.residuals.size() > static_cast<size_t>(parsed.fixes)) throw Damaged();
  return parsed;
}

}  // namespace

void writeGeoreference(const fs::path& file, const std::optional<Georeference>& fit, const std::string& reason,
                       const SourceCapture& source) {
  const Json json = fit ? toJson(*fit, source) : Json{{"reason", reason}};
  // Names of photos need not be UTF-8.
  writeFileAtomically(file, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

GeoreferenceFile readGeoreference(const fs::path& file) {
  try {
    return parseGeoreference(Json::parse(readTextFile(file), nullptr, false));
  } catch (const Damaged&) {
    throw Error(file.string(), "", "does not describe a georeference", "remove it, and run again");
  }
}

std::string describeDisagreeing(const GeoreferenceFile& georeference) {
  std::vector<std::string> photos;
  double farthest = 0;
  for (const GeoreferenceFile::Residual& residual : georeference.residuals) {
    if (residual.isInlier) continue;
    photos.push_back(residual.photo);
    farthest = std::max(farthest, residual.metres.norm());
  }
  if (photos.empty()) return "";
  return fmt::format(
      "{} of {} GPS fixes disagree with the poses, by up to {:.0f} m ({}): either these fixes are wrong, or the poses "
      "of these photos are, as where a place repeats itself",
      photos.size(), georeference.fixes, farthest, abbreviateList(photos));
}

}  // namespace tessera
