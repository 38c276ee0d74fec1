// The mathematics of every operation in double, independent of devices. The reference device wraps these functions, the
// other devices are compared with them, and gradients are checked against their finite differences. Arrays are plain,
// row-major and exactly as long as the number of samples, rays or points; the header of each operation defines their
// meaning.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace tessera {

struct Adam;
struct AttentionShape;
struct BlockSpace;
struct HashGrid;
struct MarchSpace;
struct MlpShape;
struct OctahedraGrid;
struct RayCamera;
struct StoreTexelsForward;
struct VirtualGrid;
enum class ColourLossKind;
enum class Extinction;

}  // namespace tessera

namespace tessera::reference {

using Doubles = std::vector<double>;
using View = std::span<const double>;
using Indices = std::span<const uint32_t>;

struct LossAndGradients {
  double loss = 0;
  Doubles gradients;
};

// hash_grid.cpp
Doubles hashGridForward(const HashGrid& grid, View positions, View table);  // [n][columns]
struct HashGridGradients {
  Doubles table, positions;
};
HashGridGradients hashGridBackward(const HashGrid& grid, View positions, View table, View encodedGradients);

// mlp.cpp
struct MlpResult {
  Doubles output;       // [n][outputs]
  Doubles activations;  // [hiddenLayers][n][width]
};
MlpResult mlpForward(const MlpShape& shape, size_t samples, View input, View weights);
struct MlpGradients {
  Doubles weights, input;
};
// `outputGradients` already includes MlpBackward::firstOutputGradients.
MlpGradients mlpBackward(const MlpShape& shape, size_t samples, View input, View weights, View output, View activations,
                         View outputGradients);

// encodings.cpp: one direction, one input vector
Doubles sphericalHarmonics(int degree, const double direction[3]);  // [degree²]
std::array<double, 3> sphericalHarmonicsBackward(int degree, const double direction[3], View gradients);
Doubles frequencyEncoding(int dimensions, int frequencies, const double* input);
Doubles frequencyEncodingBackward(int dimensions, int frequencies, const double* input, View gradients);

// rays.cpp
using Point = std::array<double, 3>;
Point contract(const Point& x);    // MERF, eq. 4
Point uncontract(const Point& y);  // its inverse
Point gridFromScene(const MarchSpace& space, const Point& x);
uint32_t occupancyCellIndex(const MarchSpace& space, const Point& u);
Point generateRay(const RayCamera& camera, double pixelX, double pixelY);  // unit direction, or zero if there is none

struct MarchSample {
  uint64_t step = 0;  // k of the lattice position n = k + jitter
  double distance = 0, length = 0;
  Point u{};  // grid coordinates
  uint32_t cell = 0;
};
// Every lattice position inside the space, occupied or not. By definition, marching keeps the occupied ones of these.
std::vector<MarchSample> latticeOfRay(const MarchSpace& space, const Point& origin, const Point& direction,
                                      double jitter, double far);
std::vector<MarchSample> marchRay(const MarchSpace& space, const Point& origin, const Point& direction, double jitter,
                                  double far, Indices occupancy);

// occupancy.cpp
struct OccupancyChoice {
  std::vector<uint32_t> cells;
  std::vector<float> positions;  // [points][3]; float, because every device must compute the same bits
};
// All cells are candidates if `candidates` is empty.
OccupancyChoice occupancyPoints(const MarchSpace& space, uint32_t uniform, uint32_t occupied, uint64_t seed,
                                Indices candidates, Indices occupancy);
double marchStepAtCell(const MarchSpace& space, uint32_t cell);
void occupancyUpdate(const MarchSpace& space, double decay, double threshold, Indices cells, View logDensity,
                     std::span<double> grid, std::span<uint32_t> occupancy);

// octahedra.cpp
struct FaceHit {
  uint32_t face = 0;
  double distance = 0;
  Point position{};      // grid coordinates
  Point barycentrics{};  // of all three vertices
};
// The cells of the vertices of a face; nothing if the face does not exist.
std::optional<std::array<uint32_t, 3>> verticesOfFace(const OctahedraGrid& grid, uint32_t face);
Point gridVertex(const OctahedraGrid& grid, View displacements, uint32_t vertex);
// Where the line through `origin` along `direction` meets the plane of a face: outside the face if a barycentric
// coordinate is negative. Nothing if the line is parallel to the plane.
std::optional<FaceHit> hitPlaneOfFace(const OctahedraGrid& grid, View displacements, const Point& origin,
                                      const Point& direction, uint32_t face);
// The distance at which a ray leaves the box, or 0 if it does not cross it.
double distanceBehindBox(const std::array<float, 3>& halfEdges, const Point& origin, const Point& direction);
// Tries every face near the ray.
std::vector<FaceHit> traceOctahedra(const OctahedraGrid& grid, View displacements, Indices occupancy,
                                    const Point& origin, const Point& direction, double near, double far);
// [3][3]: one hit's gradients with respect to the three vertices of its face.
Doubles octahedraBackward(const OctahedraGrid& grid, View displacements, double minCosine, const Point& origin,
                          const Point& direction, const FaceHit& hit, const Point& positionGradient,
                          double distanceGradient);

// blocks.cpp: one ray, one point
std::array<double, 2> rangeInScene(const BlockSpace& space, const Point& origin, const Point& direction,
                                   double near = 0);
Doubles firstFences(uint32_t intervals, double jitter);
struct FencedRay {
  Point origin{}, direction{};
  double near = 0, far = 0;  // the range
  double farthest = std::numeric_limits<double>::infinity();
  Doubles fences;  // in s
};
struct BlockSample {
  uint32_t block = 0;
  Point position{};
  double distance = 0, step = 0;
  double middle = 0, width = 0;  // in s
  double runtimeStep = 0;
};
// Runtime steps are not computed if `texels` is 0.
std::vector<BlockSample> blockSamples(const BlockSpace& space, const FencedRay& ray, bool split, uint32_t texels);
struct BlockPoint {
  uint32_t block = 0;
  Point position{};
  double runtimeStep = 0;
};
BlockPoint blockPoint(const BlockSpace& space, Indices blocks, uint32_t texels, uint64_t seed, uint32_t point);

// block_march.cpp: all intervals of one ray, occupied or not
struct BlockInterval {
  uint32_t block = 0;
  Point position{};
  double distance = 0, step = 0;
  double middle = 0, width = 0;
};
std::vector<BlockInterval> blockIntervals(const BlockSpace& space, double share, const Point& origin,
                                          const Point& direction, double jitter, double near, double far);

// proposals.cpp: one ray
Doubles resampledFences(View fences, View weights, uint32_t after, double anneal, double padding, double jitter);
// One ray of InterlevelLoss, unscaled; the gradients are with respect to `weights`, the weights of the proposal.
LossAndGradients interlevelLossOfRay(View fences, View weights, View middles, View widths, View sampleWeights);

// composite.cpp: one ray
struct RaySamples {
  View x, steps, distances, colours;  // [n], [n], [n] or empty, [n][columns]
  Doubles background = {};            // [columns]; empty: black
  size_t columns = 3;
};
struct RayColour {
  Doubles colour;
  double opacity = 0, depth = 0;
  Doubles weights;
};
double computeOpacity(Extinction extinction, double x, double step);
RayColour compositeRay(Extinction extinction, double minTransmittance, const RaySamples& samples);
struct RayGradients {
  Doubles x, colours;
};
// `weightGradients` may be empty.
RayGradients compositeRayBackward(Extinction extinction, double minTransmittance, const RaySamples& samples,
                                  const Doubles& colourGradient, double opacityGradient, double depthGradient,
                                  View weightGradients);

// One ray of OpaqueForward; colours are [n][3].
struct OpaqueColour {
  Point colour{};
  double opacity = 0;
};
OpaqueColour compositeOpaque(View alphas, View colours, double threshold, double maxOpacity, double minOpacity);
struct OpaqueGradients {
  Doubles alphas, colours;
};
OpaqueGradients compositeOpaqueBackward(View alphas, View colours, double threshold, double maxOpacity,
                                        double minOpacity, const Point& gradient);

// cube_map.cpp: one direction
struct CubeMapTexel {
  uint32_t number = 0;
  double weight = 0;
};
// The four texels around a direction; none for a direction of zero.
std::vector<CubeMapTexel> cubeMapTexels(uint32_t resolution, const Point& direction);
Point cubeMapColour(uint32_t resolution, View texels, const Point& direction);

// virtual_grid.cpp
struct VirtualCorner {
  uint32_t texel = 0;
  double weight = 0;
};
std::vector<VirtualCorner> virtualCorners(const VirtualGrid& grid, const Point& position);
// The row to which DistinctTexels assigned a corner of a sample.
size_t virtualRow(const VirtualGrid& grid, Indices marks, Indices ranks, uint32_t block, size_t sample, size_t corner,
                  uint32_t texel);
double quantised(const VirtualGrid& grid, double attribute);
// Log density, 3 diffuse colours and 4 features of a sample whose corners have the (quantised) `attributes`,
// [corners][8].
Doubles virtualSample(const VirtualGrid& grid, std::span<const VirtualCorner> corners, View attributes);
// patches.cpp
struct PatchTexel {
  uint32_t number = 0;
  double weight = 0;
};
// The four texels around a hit, of PatchTexels. `place` is that of the face, `barycentrics` are those of its vertices,
// and `factors` those of the corners of the patch, or empty.
std::array<PatchTexel, 4> patchTexels(uint32_t patchEdge, uint32_t place, const Point& barycentrics, View factors);
// One row of StoreTexelsForward. Without `rounds`, features are only limited to their ranges and opacities are those of
// the logit: the function whose gradient StoreTexelsBackward computes.
Doubles storedTexel(const StoreTexelsForward& options, View ranges, View features, bool rounds = true);
// attention.cpp: one sample; its log density is not clamped
Doubles fusedFeatures(const AttentionShape& shape, View coarse, View fine, View logits);
Point shadedColour(const double diffuse[3], const double specular[3], double opacity);
// deferred.cpp: one segment of a ray
Point deferredForward(View network, View composited, const double direction[3]);
struct DeferredGradients {
  Doubles network, composited;
};
DeferredGradients deferredBackward(View network, View composited, const double direction[3], const Point& gradient);

// blend.cpp: the segments of one ray
struct RaySegments {
  View composited, specular, opacities, depths;  // [n][7], [n][3], [n], [n] or empty
};
struct BlendedRay {
  Point colour{};
  double opacity = 0, depth = 0;
};
BlendedRay blendRay(bool literal, const RaySegments& segments);
struct BlendGradients {
  Doubles composited, specular, opacities;
};
BlendGradients blendRayBackward(bool literal, const RaySegments& segments, const Point& colourGradient,
                                double opacityGradient);

// losses.cpp
struct ValueAndSlope {
  double value = 0, slope = 0;
};
ValueAndSlope colourLoss(ColourLossKind kind, double parameter, double residual);
double warpDistance(double t);  // g of DistortionLoss (MERF)
// Distortion of bins [fences[i], fences[i+1]] on normalised positions, computed by the double sum.
LossAndGradients distortionOfFences(View fences, View weights);
// One ray of DistortionLoss, unscaled; intervals need not touch.
LossAndGradients distortionOfRay(View weights, View distances, View steps, bool normalised = false);
// One ray of DepthLoss, unscaled.
LossAndGradients depthLossOfRay(double known, double tolerance, View weights, View distances);
// The order in which S3imLoss uses `rays` rays in patch `patch`.
std::vector<uint32_t> s3imOrder(uint32_t rays, uint32_t patch, uint64_t seed);
// SSIM of one channel of a group of 16 rays; the gradient is with respect to x.
LossAndGradients ssimOfGroup(const double x[16], const double y[16]);
// All rays, unscaled; `weights` may be empty.
LossAndGradients s3imLoss(View predicted, View target, View weights, uint32_t patches, uint64_t seed);
ValueAndSlope opacityLoss(double opacity);
ValueAndSlope sparsityLoss(double logDensity, double runtimeStep);
// One ray of DitherLoss, unscaled; colours are [n][3].
double ditherLossOfRay(View weights, View colours, const Point& colour, double opacity, const Point& background);

// adam.cpp
struct AdamState {
  double parameter = 0, firstMoment = 0, secondMoment = 0;
  uint32_t count = 0;
};
void adamStep(const Adam& options, double gradient, AdamState& state);

}  // namespace tessera::reference
