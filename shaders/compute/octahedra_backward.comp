// OctahedraBackward: one invocation per hit, which adds to the three vertices of its face.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_octahedra.h"
#include "octahedra.glsl"
#include "vectors.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(OctahedraBackwardArguments)

#define MATRIX(i) arguments.values.grids[grid].gridFromScene[i]

void main() {
  OctahedraBackwardArguments a = arguments.values;
  const int n = int(a.resolution);
  FOR_EACH_ROW(index, a.samples) {
    const uint face = a.faces.values[index], cells = n * n * n, grid = face / kFacesPerCell / cells;
    const uint firstCell = grid * cells, cell = face / kFacesPerCell - firstCell, ray = a.rayOfSample.values[index];
    const ivec3 octahedron = ivec3(cell % n, cell / n % n, cell / (n * n));
    uint vertices[3];
    vec3 v[3];  // relative to the centre of the octahedron's cell
    for (uint corner = 0; corner < 3; ++corner) {
      const ivec3 offset = faceCorner(face % kFacesPerCell, corner), place = octahedron + offset;
      vertices[corner] = firstCell + place.x + n * (place.y + n * place.z);
      v[corner] = vec3(offset) + pointAt(a.displacements, vertices[corner]);
    }
    const vec3 normal = cross(v[1] - v[0], v[2] - v[0]);
    // The derivative of the ray in grid coordinates, g = p / w.
    const vec3 origin = pointAt(a.origins, ray), direction = pointAt(a.directions, ray);
    const float t = a.distances.values[index];
    vec4 start, rise;
    for (int row = 0; row < 4; ++row) {
      const vec4 m = vec4(MATRIX(4 * row), MATRIX(4 * row + 1), MATRIX(4 * row + 2), MATRIX(4 * row + 3));
      start[row] = dot(m, vec4(origin, 1));
      rise[row] = dot(m.xyz, direction);
    }
    const vec4 at = start + t * rise;
    const vec3 slope = (rise.xyz - at.xyz / at.w * rise.w) / at.w;
    float across = dot(normal, slope);
    const float least = a.minCosine * length(normal) * length(slope);
    if (abs(across) < least) across = across < 0 ? -least : least;
    if (across == 0) continue;
    float along = dot(slope, pointAt(a.positionGradients, index)) * arguments.values.grids[grid].positionScale;
    if (IS_SET(a.distanceGradients)) along += a.distanceGradients.values[index];
    const float second = a.barycentrics.values[2 * index], third = a.barycentrics.values[2 * index + 1];
    const vec3 shares = vec3(1 - second - third, second, third) * (along / across);
    for (uint corner = 0; corner < 3; ++corner) {
      for (uint axis = 0; axis < 3; ++axis) {
        addTo(a.displacementGradients, 3 * vertices[corner] + axis, shares[corner] * normal[axis]);
      }
    }
  }
}
