// Reads transforms.json as written by nerfstudio, instant-ngp, Blender's NeRF exporter and scene/capture_writer.h.
//
// Poses are camera-to-world with OpenGL axes (right, up, backward). nerfstudio's applied_transform and applied_scale
// state the transform that its converter has already applied to both poses and point cloud; so both are read unchanged,
// and the two keys only enter `sourceFromWorld`. That converter does not scale depth maps: their unit is multiplied by
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

// The intrinsics of a lens as a file states them, at the top level or in a frame; all may be missing.
struct Intrinsics {
  std::string model;  // camera_model
  bool fisheye = false;
  std::map<std::string, double> numbers;  // w, h, fl_x, fl_y, cx, cy, k1.., p1, p2, camera_angle_x, x_fov, ...
};

struct TransformsFrame {
  std::string file, mask, depth;                // as written; may be empty (file never is)
  Mat4d worldFromCameraGl = Mat4d::Identity();  // unchecked: may contain NaN or not be rigid
  Intrinsics intrinsics;                        // the frame's own override those of the file
  int camera = -1;                              // index into TransformsFile::cameras, -1: use the intrinsics
  std::string name;
  std::optional<double> exposure;
  int orientation = 1;  // of EXIF, 1 to 8
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
  std::vector<SplitList> splitLists;  // train, validation, test, as far as the file has them
  std::string pointFile, observationFile;
  Mat4d appliedTransform = Mat4d::Identity();  // invertible; its last row is 0 0 0 1
  double appliedScale = 1;
  std::string appliedTrouble;                    // why one of the two was ignored; empty if none was
  bool isOfColmap = false;                       // nerfstudio's converter wrote it: Z is an axis of COLMAP's world
  double integerDepthScale = 0;                  // instant-ngp: world units per step, 0: not given
  std::set<std::string> unknownKeys;             // of the file and its frames
  std::map<std::string, std::string> unmetKeys;  // known but unsupported keys → the consequence
  // Set for our own captures only.
  bool isOurs = false;
  std::vector<Camera> cameras;
  Mat4d sourceFromWorld = Mat4d::Identity();
  std::optional<GeoFrame> geo;
};

// Decodes untrusted text. Returns nothing, with the reason in `reason`, if it is not such a file. Unknown keys are
// recorded; NaN and Infinity are accepted as Python writes them.
std::optional<TransformsFile> decodeTransforms(std::string_view text, std::string& reason);

// Reads and decodes a file. Throws Error naming it if it cannot be read or decoded.
TransformsFile loadTransforms(const fs::path& file);

// Whether a folder has a transforms.json that is not one of our captures.
bool holdsPosesOfOthers(const fs::path& folder);

// Returns the camera for a photo of that size (which is used where the file gives none), or nothing, with the reason in
// `reason`, for an unsupported lens or a lens without a focal length.
std::optional<Camera> cameraFromIntrinsics(const Intrinsics& intrinsics, int photoWidth, int photoHeight,
                                           std::string& reason);

// Returns the transforms*.json files of a source folder (or the source itself if it is such a file): transforms.json,
// else Blender's three.
std::vector<fs::path> findTransforms(const fs::path& source);
// Reads the files as one capture. Throws Error naming the file that cannot be read or decoded, or that does
// not fit transforms.json.
SourceCapture readTransforms(const std::vector<fs::path>& files);

}  // namespace tessera
