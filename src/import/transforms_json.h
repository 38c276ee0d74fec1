// transforms.json as nerfstudio, instant-ngp and Blender's NeRF exporter write it, and as scene/capture_writer.h does.
//
// Poses are camera-to-world with OpenGL axes (right, up, backward). nerfstudio's applied_transform and applied_scale
// say what its converter has already done to poses and to the point cloud alike; so both stay as the file has them, and
// the two only enter `sourceFromWorld`. Depth pictures were not scaled by that converter: their unit is multiplied by
// applied_scale.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "import/source.h"

namespace tessera {

// The numbers of a lens as a file gives them, at the top or in a frame; all may be missing.
struct Intrinsics {
  std::string model;  // camera_model
  bool fisheye = false;
  std::map<std::string, double> numbers;  // w, h, fl_x, fl_y, cx, cy, k1.., p1, p2, camera_angle_x, x_fov, ...
};

struct TransformsFrame {
  std::string file, mask, depth;                // as written; may be empty (file never is)
  Mat4d worldFromCameraGl = Mat4d::Identity();  // unchecked: may be not-a-number or not rigid
  Intrinsics intrinsics;                        // the frame's own over the file's
  int camera = -1;                              // index into TransformsFile::cameras, -1: use the intrinsics
  std::string name;
  double exposure = 0;
  float depthUnit = 0;  // 0: not given
  std::optional<GpsFix> gps;
};

// train_filenames, val_filenames or test_filenames.
struct SplitList {
  std::string key;
  Split split = Split::train;
  std::vector<std::string> names;  // as written
};

struct TransformsFile {
  std::vector<TransformsFrame> frames;
  std::vector<SplitList> splitLists;  // train, validation, test, as far as they are there
  std::string pointFile, observationFile;
  Mat4d appliedTransform = Mat4d::Identity();  // invertible; its last row is 0 0 0 1
  double appliedScale = 1;
  std::string appliedTrouble;                    // why one of the two was not taken over; empty when all is well
  double integerDepthScale = 0;                  // instant-ngp: world units per step, 0: not given
  std::set<std::string> unknownKeys;             // of the file and its frames
  std::map<std::string, std::string> unmetKeys;  // known, not followed → what comes of that
  // Of our own captures only.
  bool isOurs = false;
  std::vector<Camera> cameras;
  Mat4d sourceFromWorld = Mat4d::Identity();
  std::optional<GeoFrame> geo;
};

// Untrusted text: nothing, and why in `reason`, when it is not such a file. Unknown keys are noted; NaN and
// Infinity as Python writes them are understood.
std::optional<TransformsFile> decodeTransforms(std::string_view text, std::string& reason);

// The same of a file; throws Error.
TransformsFile loadTransforms(const fs::path& file);

// The camera for a photo of that size (used where the file gives none). Nothing for a lens that is not known, or that
// has no focal length.
std::optional<Camera> cameraFromIntrinsics(const Intrinsics& intrinsics, int photoWidth, int photoHeight,
                                           std::string& reason);

// The transforms*.json files of a source folder (or the file itself): transforms.json, else Blender's three.
std::vector<fs::path> findTransforms(const fs::path& source);
SourceCapture readTransforms(const std::vector<fs::path>& files);

}  // namespace tessera
