// For tests: a reference rasteriser on the CPU in double precision, and the arguments with which the GPU draws the same
// triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "gpu/image.h"

namespace tessera::gpu_test {

// The layouts of shaders/gpu/triangle_arguments.glsl.
struct Vertex {
  std::array<float, 4> position;  // clip space, w above 0
  std::array<float, 4> colour = {};
};
struct TriangleArguments {
  uint64_t vertices = 0, indices = 0, covered = 0, largest = 0;
  std::array<float, 2> shift = {};
  uint32_t width = 0, unused = 0;
};

struct Triangles {
  std::vector<Vertex> vertices;
  std::vector<uint32_t> indices;
};

// Returns random triangles of various sizes, positions and windings with depths from 0.1 to 0.9. Some extend beyond the
// image. Each vertex has its own w and colour.
Triangles randomTriangles(uint64_t seed, size_t count);

struct RasterisedPixel {
  uint32_t number = 0;   // of the nearest triangle, counted from 1; 0 if there is none
  uint32_t covered = 0;  // the number of triangles that cover the pixel
  uint32_t largest = 0;  // triangle number among those
  double depth = 1;      // of the nearest triangle
  std::array<double, 4> colour = {};
  bool isCertain = true;  // no edge is close and no two depths are nearly equal, so all implementations agree
};

enum class Faces { all, clockwise, counterClockwise };  // as seen in the image, y downwards

// Returns [height][width] pixels.
std::vector<RasterisedPixel> rasterise(const Triangles& triangles, ImageSize size, Faces faces = Faces::all);

}  // namespace tessera::gpu_test
