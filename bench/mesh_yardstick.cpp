// mesh_yardstick SCENE CAPTURE [IMAGES]: a mesh scene of a synthetic city against what an ideal photogrammetric mesh
// would show. CAPTURE: the photos that the scene was trained on. The mesh has the city's own triangles, with leaves cut
// out exactly; its textures have as many texels as all patches of the scene's finest level, used and unused, with the
// background block. Triangles that no training photo sees have none. The others have texels in proportion to the
// pixels that photos spend on a metre of them on average, on a lattice along their two shorter edges. The colour of a
// texel is, over all training photos that see it by ray casting,
//   mean      the mean
//   sharpest  the mean weighted by the pixels that they spend on its area, because photos from afar blur it
// Both are evaluated on the held-out photos with one ray through the middle of each pixel, as the scene is, and, for
// the sharpest, with 3 × 3: the nearest hit, four texels mixed bilinearly, and the city's exact sky. What no photo
// shows has the mean colour of its triangle or object. Prints PSNR and SSIM as JSON, and the PSNR of those pixels alone
// whose surface lies in the scene's box. IMAGES: a folder for pictures. See mesh.sh.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>

#include "base/error.h"
#include "base/image_io.h"
#include "bench/evaluation.h"
#include "bench/mesh_scene.h"
#include "bench/synthetic_city.h"
#include "eval/evaluate.h"
#include "eval/psnr.h"
#include "import/capture_reader.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/cpu/mesh_drawer.h"
#include "synth/photographer.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

// Two colours of three bytes, and where they are from.
using Texel = std::array<uint8_t, 7>;
constexpr int kMean = 0, kSharpest = 3, kOrigin = 6;  // kOrigin: 0 its face, 1 photos, 2 its neighbours
using TwoColours = Eigen::Array<float, 6, 1>;

uint64_t countTexels(const fs::path& folder) {
  uint64_t texels = 0;
  for (const Tile& tile : readTileset(folder).tiles)
    for (const TileContent& content : tile.contents) {
      if ((content.backgroundBlock ? content.level : tile.level) != 0) continue;
      const auto mesh = readContent(contentPath(folder, content.uri), meshCodec());
      for (const PatchSet& part : contentAs<MeshContent>(*mesh).parts)
        texels += uint64_t{part.patches} * part.patchEdge * part.patchEdge;
    }
  return texels;
}

// The texture of a triangle, or of a square of foliage: a lattice over a parallelogram.
struct FaceTexture {
  Vec3f corner, alongU, alongV;
  bool isLeafSquare = false;
  float pixelsPerMetre = 0;        // of the photos that see it; 0 if none does
  uint32_t columns = 0, rows = 0;  // at least 2 each
  size_t first = 0;                // its first texel
  Texel colour{};                  // where it has no texels

  Vec3f at(float u, float v) const { return corner + u * alongU + v * alongV; }
  // The texels of a row on which a point of the triangle depends: those of the lattice's cells whose lower corner is in
  // the triangle.
  uint32_t usedColumns(uint32_t row) const {
    if (isLeafSquare) return columns;
    const float v = static_cast<float>(std::max(row, 1u) - 1) / static_cast<float>(rows - 1);
    return std::min(columns, 1 + static_cast<uint32_t>(std::ceil((1 - v) * static_cast<float>(columns - 1))));
  }
  uint64_t countUsed() const {
    uint64_t count = 0;
    for (uint32_t row = 0; row < rows; ++row) count += usedColumns(row);
    return count;
  }
  void setSize(float texelsPerPixel) {
    const float perMetre = texelsPerPixel * pixelsPerMetre;
    const auto count = [&](float metres) { return 1 + std::clamp(std::ceil(metres * perMetre), 1.0f, 4095.0f); };
    columns = static_cast<uint32_t>(count(alongU.norm()));
    rows = static_cast<uint32_t>(count(alongV.norm()));
  }
};

struct TrainingPhoto {
  const Camera& camera;
  Pose pose;
  ImageU8 image;
};

class TexturedCity final : public ViewRenderer {
 public:
  TexturedCity(const fs::path& captureFolder, const Capture& capture)
      : city_(rebuildCity(captureFolder, pool_)), solids_(city_->mesh.faces.size()) {
    makeFaces();
    for (const Photo& photo : capture.photos)
      if (photo.split == Split::train)
        photos_.push_back({capture.cameras[photo.camera], photo.worldFromCamera, readImage(photo.image).image});
    measureFaces();
  }

  // Gives faces up to so many texels together, and fills them.
  void fill(uint64_t texels) {
    float low = 1e-2f, high = 1e2f;
    for (int i = 0; i < 40; ++i) {
      const float middle = std::sqrt(low * high);
      (sizeFaces(middle) > texels ? high : low) = middle;
    }
    texels_ = sizeFaces(low);
    texelsPerPixel_ = low;
    size_t all = 0;
    for (FaceTexture& face : faces_) {
      face.first = all;
      if (face.pixelsPerMetre > 0) all += size_t{face.columns} * face.rows;
    }
    colours_.assign(all, Texel{});
    pool_.forRanges(faces_.size(), 64, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i)
        if (faces_[i].pixelsPerMetre > 0) fillFace(i);
    });
    colourTheRest();
  }

  int shown = kMean;  // the colour that is rendered
  int raysPerPixelEdge = 1;

  RenderedView render(const Camera& camera, const Pose& pose, const ImageF*) override {
    RenderedView view = makeEmptyView(camera);
    pool_.run(static_cast<size_t>(camera.height), [&](size_t row, int) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < camera.width; ++x) {
        *view.opacity.at(x, y) = 1;
        const int rays = raysPerPixelEdge * raysPerPixelEdge;
        for (int i = 0; i < rays; ++i) {
          const auto hitOrSky = colourAlong(camera, pose, x + (i % raysPerPixelEdge + 0.5) / raysPerPixelEdge,
                                            y + (i / raysPerPixelEdge + 0.5) / raysPerPixelEdge);
          for (int c = 0; c < 3; ++c) view.colour.at(x, y)[c] += hitOrSky[c] / static_cast<float>(255 * rays);
        }
      }
    });
    return view;
  }
  std::string device() const override { return "Embree"; }

  nlohmann::ordered_json describe() const {
    const auto seen =
        std::count_if(faces_.begin(), faces_.end(), [](const auto& face) { return face.pixelsPerMetre > 0; });
    const auto coloured =
        std::count_if(colours_.begin(), colours_.end(), [](const Texel& texel) { return texel[kOrigin] == 1; });
    return {{"triangles_and_leaf_squares", faces_.size()},
            {"seen_by_photos", seen},
            {"texels", texels_},
            {"texels_seen_by_photos", coloured},
            {"texels_per_pixel", texelsPerPixel_}};
  }

 private:
  void makeFaces() {
    const SurfaceMesh& mesh = city_->mesh;
    for (const SurfaceFace& face : mesh.faces) {
      std::array<Vec3f, 3> p{mesh.positions[face.a], mesh.positions[face.b], mesh.positions[face.c]};
      // The corner opposite the longest edge comes first.
      const auto opposite = [&](int i) { return (p[(i + 1) % 3] - p[(i + 2) % 3]).squaredNorm(); };
      const int i = opposite(0) >= std::max(opposite(1), opposite(2)) ? 0 : opposite(1) >= opposite(2) ? 1 : 2;
      faces_.push_back({p[i], p[(i + 1) % 3] - p[i], p[(i + 2) % 3] - p[i]});
    }
    for (size_t square = 0; square < mesh.leafObjects.size(); ++square) {
      const Vec3f* p = &mesh.leafCorners[4 * square];
      faces_.push_back({p[0], p[1] - p[0], p[3] - p[0], true});
    }
  }

  size_t faceNumber(const SurfaceHit& hit) const {
    return hit.material == Material::leaf ? solids_ + hit.face : hit.face;
  }
  uint32_t objectNumber(size_t face) const {
    return face < solids_ ? city_->mesh.faces[face].object : city_->mesh.leafObjects[face - solids_];
  }

  // Determines how many pixels photos spend on a metre of each face on average, by a ray through each pixel.
  void measureFaces() {
    std::vector<double> sums(faces_.size());
    std::vector<uint32_t> counts(faces_.size());
    for (const TrainingPhoto& photo : photos_)
      for (int y = 0; y < photo.camera.height; ++y)
        for (int x = 0; x < photo.camera.width; ++x) {
          const auto ray = rayThrough(photo.camera, photo.pose, {x + 0.5, y + 0.5});
          const auto hit = ray ? city_->tracer->intersect(*ray) : std::nullopt;
          if (!hit) continue;
          sums[faceNumber(*hit)] += photo.camera.focalX() / hit->distance;
          ++counts[faceNumber(*hit)];
        }
    for (size_t i = 0; i < faces_.size(); ++i)
      if (counts[i] > 0) faces_[i].pixelsPerMetre = static_cast<float>(sums[i] / counts[i]);
  }

  uint64_t sizeFaces(float texelsPerPixel) {
    std::atomic<uint64_t> texels = 0;
    pool_.forRanges(faces_.size(), 1024, [&](size_t begin, size_t end) {
      uint64_t ofRange = 0;
      for (size_t i = begin; i < end; ++i) {
        if (faces_[i].pixelsPerMetre == 0) continue;
        faces_[i].setSize(texelsPerPixel);
        ofRange += faces_[i].countUsed();
      }
      texels += ofRange;
    });
    return texels;
  }

  void fillFace(size_t number) {
    const FaceTexture& face = faces_[number];
    Texel* texels = &colours_[face.first];
    for (uint32_t row = 0; row < face.rows; ++row)
      for (uint32_t column = 0; column < face.usedColumns(row); ++column) {
        float u = static_cast<float>(column) / static_cast<float>(face.columns - 1),
              v = static_cast<float>(row) / static_cast<float>(face.rows - 1);
        if (const float beyond = u + v - 1; !face.isLeafSquare && beyond > 0) {
          u = std::clamp(u - beyond / 2, 0.0f, 1.0f);
          v = 1 - u;
        }
        if (const auto colours = meanColours(number, face.at(u, v))) {
          Texel& texel = texels[row * face.columns + column];
          for (int c = 0; c < 6; ++c) texel[c] = static_cast<uint8_t>(std::lround((*colours)[c]));
          texel[kOrigin] = 1;
        }
      }
    for (int round = 0; round < 2; ++round) grow(face, texels);
  }

  // Gives texels that no photo sees the mean of their neighbours.
  static void grow(const FaceTexture& face, Texel* texels) {
    const std::vector<Texel> before(texels, texels + size_t{face.columns} * face.rows);
    for (int row = 0; row < static_cast<int>(face.rows); ++row)
      for (int column = 0; column < static_cast<int>(face.columns); ++column) {
        if (before[row * face.columns + column][kOrigin] != 0) continue;
        std::array<int, 6> sum{};
        int count = 0;
        for (const auto& [dx, dy] : {std::pair(-1, 0), {1, 0}, {0, -1}, {0, 1}}) {
          const int x = column + dx, y = row + dy;
          if (x < 0 || y < 0 || x >= static_cast<int>(face.columns) || y >= static_cast<int>(face.rows)) continue;
          const Texel& near = before[y * face.columns + x];
          if (near[kOrigin] == 0) continue;
          for (int c = 0; c < 6; ++c) sum[c] += near[c];
          ++count;
        }
        if (count == 0) continue;
        Texel& texel = texels[row * face.columns + column];
        for (int c = 0; c < 6; ++c) texel[c] = static_cast<uint8_t>(sum[c] / count);
        texel[kOrigin] = 2;
      }
  }

  std::optional<TwoColours> meanColours(size_t number, const Vec3f& at) const {
    TwoColours sums = TwoColours::Zero();
    float count = 0, weights = 0;
    for (const TrainingPhoto& photo : photos_) {
      const Vec3d inCamera = photo.pose.rotation.transpose() * (at.cast<double>() - photo.pose.translation);
      const auto pixel = photo.camera.pixelFromCamera(inCamera);
      if (!pixel || pixel->x() < 0.5 || pixel->y() < 0.5 || pixel->x() > photo.camera.width - 0.5 ||
          pixel->y() > photo.camera.height - 0.5)
        continue;
      const Vec3f eye = photo.pose.translation.cast<float>(), towards = at - eye;
      const float distance = towards.norm();
      const auto hit = city_->tracer->intersect({eye, towards / distance, 0.05f});
      if (!hit || std::abs(hit->distance - distance) > 0.02f) continue;
      // Rays through gaps between leaves pass such a square, and rays at an edge may meet the next wall.
      if (faces_[number].isLeafSquare ? faceNumber(*hit) != number : hit->material == Material::leaf) continue;
      const Eigen::Array3f colour = colourOfPhoto(photo.image, pixel->x() - 0.5, pixel->y() - 0.5);
      const float facing = std::abs(hit->normal.dot(towards)) / distance,
                  weight = std::max(1e-3f, facing) / (distance * distance);
      sums.head<3>() += colour;
      sums.tail<3>() += weight * colour;
      count += 1;
      weights += weight;
    }
    if (count == 0) return std::nullopt;
    sums.head<3>() /= count;
    sums.tail<3>() /= weights;
    return sums;
  }

  static Vec3f colourOfPhoto(const ImageU8& image, double x, double y) {
    const int x0 = std::clamp(static_cast<int>(x), 0, image.width - 2),
              y0 = std::clamp(static_cast<int>(y), 0, image.height - 2);
    const float fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
    Vec3f colour;
    for (int c = 0; c < 3; ++c)
      colour[c] = (1 - fy) * ((1 - fx) * image.at(x0, y0)[c] + fx * image.at(x0 + 1, y0)[c]) +
                  fy * ((1 - fx) * image.at(x0, y0 + 1)[c] + fx * image.at(x0 + 1, y0 + 1)[c]);
    return colour;
  }

  // Gives texels and faces that no photo sees the mean colour of their face, of their object, or of everything.
  void colourTheRest() {
    struct Mean {
      std::array<uint64_t, 6> sum{};
      uint64_t count = 0;
      void add(const Mean& other) {
        for (int c = 0; c < 6; ++c) sum[c] += other.sum[c];
        count += other.count;
      }
    };
    std::vector<Mean> ofFace(faces_.size()), ofObject(city_->mesh.objects.size());
    Mean ofAll;
    const auto forTexels = [&](const FaceTexture& face, const auto& use) {
      if (face.pixelsPerMetre > 0) std::for_each_n(&colours_[face.first], size_t{face.columns} * face.rows, use);
    };
    for (size_t i = 0; i < faces_.size(); ++i) {
      forTexels(faces_[i], [&](const Texel& texel) {
        if (texel[kOrigin] != 1) return;
        Mean one{{}, 1};
        std::copy_n(texel.begin(), 6, one.sum.begin());
        ofFace[i].add(one);
      });
      ofObject[objectNumber(i)].add(ofFace[i]);
      ofAll.add(ofFace[i]);
    }
    for (size_t i = 0; i < faces_.size(); ++i) {
      const Mean& object = ofObject[objectNumber(i)];
      const Mean& mean = ofFace[i].count > 0 ? ofFace[i] : object.count > 0 ? object : ofAll;
      for (int c = 0; c < 6; ++c)
        faces_[i].colour[c] = static_cast<uint8_t>(mean.sum[c] / std::max<uint64_t>(1, mean.count));
      forTexels(faces_[i], [&](Texel& texel) {
        if (texel[kOrigin] == 0) texel = faces_[i].colour;
      });
    }
  }

  Vec3f colourAlong(const Camera& camera, const Pose& pose, double x, double y) const {
    const auto ray = rayThrough(camera, pose, {x, y});
    if (!ray) return Vec3f::Zero();
    const auto hit = city_->tracer->intersect(*ray);
    return hit ? colourAt(*hit) : sky(ray->direction);
  }
  Vec3f colourAt(const SurfaceHit& hit) const {
    const FaceTexture& face = faces_[faceNumber(hit)];
    if (face.pixelsPerMetre == 0) return toVector(&face.colour[shown]);
    // The place in the parallelogram, by least squares.
    const Vec3f from = hit.position - face.corner;
    const float uu = face.alongU.squaredNorm(), vv = face.alongV.squaredNorm(), uv = face.alongU.dot(face.alongV),
                u = from.dot(face.alongU), v = from.dot(face.alongV), determinant = std::max(1e-12f, uu * vv - uv * uv);
    const float x = std::clamp((u * vv - v * uv) / determinant, 0.0f, 1.0f) * static_cast<float>(face.columns - 1),
                y = std::clamp((v * uu - u * uv) / determinant, 0.0f, 1.0f) * static_cast<float>(face.rows - 1);
    const uint32_t x0 = std::min(static_cast<uint32_t>(x), face.columns - 2),
                   y0 = std::min(static_cast<uint32_t>(y), face.rows - 2);
    const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
    const Texel* texel = &colours_[face.first + size_t{y0} * face.columns + x0];
    const auto at = [&](uint32_t i) { return toVector(&texel[i][shown]); };
    return (1 - fy) * ((1 - fx) * at(0) + fx * at(1)) + fy * ((1 - fx) * at(face.columns) + fx * at(face.columns + 1));
  }
  Vec3f sky(const Vec3f& direction) const { return toVector(developed(city_->sky.radiance(direction), 0).data()); }
  static Vec3f toVector(const uint8_t* bytes) {
    return {static_cast<float>(bytes[0]), static_cast<float>(bytes[1]), static_cast<float>(bytes[2])};
  }

  ThreadPool pool_{0};
  std::unique_ptr<CityScene> city_;
  size_t solids_;
  std::vector<FaceTexture> faces_;  // the triangles, then the squares of foliage
  std::vector<TrainingPhoto> photos_;
  std::vector<Texel> colours_;
  uint64_t texels_ = 0;
  float texelsPerPixel_ = 0;
};

// Evaluates the held-out photos, and of their pixels also those alone whose surface lies in the scene's box.
nlohmann::ordered_json judge(ViewRenderer& renderer, const Capture& capture, const TileFrame& frame,
                             const fs::path& imagesDir) {
  std::vector<double> inBox;
  EvaluateOptions options = optionsOfEnvironment();
  options.imagesDir = imagesDir;
  options.onView = [&](const ViewResult& result, const ViewPictures& pictures) {
    const auto photo = std::find_if(capture.photos.begin(), capture.photos.end(),
                                    [&](const Photo& other) { return other.name == result.name; });
    const Camera& camera = capture.cameras[photo->camera];
    ImageU8 mask(camera.width, camera.height, 1);
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const float z = *pictures.measuredDepth->at(x, y);
        const auto inCamera = camera.directionInCamera({x + 0.5, y + 0.5});
        if (!(z > 0) || !inCamera) continue;
        const Pose& pose = photo->worldFromCamera;
        const Vec3d at = frame.inScene(pose.translation + pose.rotation * *inCamera * (z / inCamera->z()));
        const bool isIn = (at.array() >= frame.low.array()).all() && (at.array() <= frame.high.array()).all();
        *mask.at(x, y) = isIn ? 255 : 0;
      }
    const double decibels = psnr(pictures.photo, pictures.rendered, &mask);
    if (std::isfinite(decibels)) inBox.push_back(decibels);
  };
  const EvaluationReport report = evaluate(renderer, capture, options);
  nlohmann::ordered_json result = describeQuality(report);
  result["psnr_in_box"] = std::accumulate(inBox.begin(), inBox.end(), 0.0) / static_cast<double>(inBox.size());
  for (const ViewResult& view : report.views) result["views"].push_back(view.psnr);
  return result;
}

nlohmann::ordered_json measure(const fs::path& folder, const fs::path& captureFolder, const fs::path& images) {
  const Capture capture = readCapture(captureFolder);
  const OpenedMeshScene scene = openMeshScene(folder, makeMeshDrawer());
  const TileFrame& frame = scene.frame;
  nlohmann::ordered_json result;
  result["scene"] = judge(*scene.renderer, capture, frame, {});
  const uint64_t texels = countTexels(folder);
  result["texels_of_scene"] = texels;
  TexturedCity city(captureFolder, capture);
  city.fill(texels);
  result.update(city.describe());
  result["mean"] = judge(city, capture, frame, images.empty() ? images : images / "mean");
  city.shown = kSharpest;
  result["sharpest"] = judge(city, capture, frame, images.empty() ? images : images / "sharpest");
  city.raysPerPixelEdge = 3;
  result["sharpest_9_rays"] = judge(city, capture, frame, {});
  return result;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc != 3 && argc != 4) {
    std::fprintf(stderr, "usage: mesh_yardstick SCENE CAPTURE [IMAGES]\n");
    return 2;
  }
  try {
    std::printf("%s\n", tessera::measure(argv[1], argv[2], argc > 3 ? argv[3] : "").dump(2).c_str());
    return 0;
  } catch (const tessera::Error& error) {
    std::fprintf(stderr, "mesh_yardstick: error: %s\n", error.what());
    return 1;
  }
}
