// For tests: what triangles look like, computed on the CPU in double precision, and what the GPU is told to draw them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "gpu/image.h"

namespace tessera::gpu_test {

// As shaders/gpu/triangle_arguments.glsl.
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

// Triangles of any size, place and winding within depths 0.1 to 0.9, some of which reach out of the picture; each
// vertex has a w and a colour of its own.
Triangles randomTriangles(uint64_t seed, size_t count);

struct RasterisedPixel {
  uint32_t number = 0;   // of the nearest triangle, counted from 1; 0: none
  uint32_t covered = 0;  // by so many triangles
  uint32_t largest = 0;  // number among those
  double depth = 1;      // of the nearest
  std::array<double, 4> colour = {};
  bool isCertain = true;  // no edge passes close by, and no two depths are nearly equal: all implementations agree
};

enum class Faces { all, clockwise, counterClockwise };  // as seen in the picture, y downwards

// [height][width]
std::vector<RasterisedPixel> rasterise(const Triangles& triangles, ImageSize size, Faces faces = Faces::all);

}  // namespace tessera::gpu_test
