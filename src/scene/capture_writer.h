// Writes a capture folder: transforms.json (nerfstudio keys, ours under "tessera"), points.ply,
// observations.safetensors. Pictures are not touched; their paths are written relative to `capture.root`.
// Read back, exactly, by import/capture_reader.h.
//
// What others read (nerfstudio, instant-ngp): camera_model, w, h, fl_x, fl_y, cx, cy, k1.., p1, p2 (at the top for one
// camera, in each frame for several), frames[] {file_path, transform_matrix (camera to world, OpenGL axes), mask_path,
// depth_file_path}, train_filenames, val_filenames, test_filenames, ply_file_path. There is no applied_transform.
// What is ours: "tessera" at the top {version, cameras[] {model, width, height, parameters}, source_from_world, geo,
// observations} and in each frame {camera, name, exposure, depth_unit, gps}. Where both speak, ours is the truth.
//
// observations.safetensors: photo u32[n] (index into frames), point u32[n] (index into points.ply), pixel f32[n, 2],
// error f32[n].
#pragma once

#include "scene/capture.h"

namespace tessera {

// Everything is written beside and renamed, transforms.json last: a folder with it is complete. Throws Error when a
// picture lies outside `capture.root` or the disk refuses.
void writeCapture(const Capture& capture);

}  // namespace tessera
