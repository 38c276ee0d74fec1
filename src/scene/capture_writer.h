// Writes a capture folder: transforms.json (nerfstudio keys, ours under "tessera"), points.ply,
// observations.safetensors. Images are not touched; their paths are written relative to `capture.root`.
// import/capture_reader.h reads all of it back exactly.
//
// Keys for other programs (nerfstudio, instant-ngp): camera_model, w, h, fl_x, fl_y, cx, cy, k1.., p1, p2 (at the top
// level for one camera, in each frame for several), frames[] {file_path, transform_matrix (camera to world, OpenGL
// axes), mask_path, depth_file_path}, train_filenames, val_filenames, test_filenames, ply_file_path. There is no
// applied_transform.
// Our own keys: "tessera" at the top level {version, cameras[] {model, width, height, parameters}, source_from_world,
// geo, observations} and in each frame {camera, name, exposure, orientation, depth_unit, gps}. Where both state a
// value, our own key takes precedence.
//
// observations.safetensors: photo u32[n] (index into frames), point u32[n] (index into points.ply), pixel f32[n, 2],
// error f32[n].
#pragma once

#include "scene/capture.h"

namespace tessera {

// Writes every file atomically, transforms.json last: a folder that contains it is complete. Throws Error if an image
// lies outside `capture.root` or a file cannot be written.
void writeCapture(const Capture& capture);

// Throws Error naming the first photo whose name is not UTF-8, which writeCapture refuses, too: for callers that do
// much before they write.
void requireUtf8Names(const std::vector<Photo>& photos);

}  // namespace tessera
