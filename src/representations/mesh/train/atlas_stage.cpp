#include "representations/mesh/train/atlas_stage.h"

#include "compute/composite.h"
#include "compute/cube_map.h"
#include "compute/patches.h"
#include "compute/rows.h"

namespace tessera {
namespace {

constexpr uint32_t kTexelsPerHit = 4;
constexpr uint32_t kMaxAtlasHits = 256;  // of a ray
constexpr uint32_t kStored = StoreTexelsForward::kStored, kStoredFeatures = StoreTexelsForward::kFeatures;
// The weight of the error of dithering, for temporal antialiasing with the weight a = 0.04 of a new frame: a / (2 - a).
constexpr double kDitherWeight = 0.02;

}  // namespace

// What belongs to one step.
struct AtlasStage::Step {
  const PhotoRays& rays;
  uint32_t count;  // rays
  Count hits, texels, finished;
  Slice<uint32_t> texelCounter;  // number of distinct texels
  Slice<const float> directions;
  Slice<float> losses;
  Matrix<const float> colours = {};  // of the hits
};

AtlasStage::AtlasStage(MeshModel& model, uint32_t level, TexelAtlas atlas, uint32_t maxRays, uint32_t hitCapacity)
    : model_(model),
      level_(level),
      device_(model.device()),
      atlas_(std::move(atlas)),
      texelCapacity_(kTexelsPerHit * hitCapacity),
      hits_(model.device(), maxRays, hitCapacity) {
  ranges_ = device_.uploadArray(model.atlas()->ranges);
  const size_t hits = hitCapacity, words = (atlas_.texels() + size_t{31}) / 32;
  for (Array<uint32_t>* perCorner : {&texels_, &rows_}) *perCorner = device_.array<uint32_t>(kTexelsPerHit * hits);
  for (Array<uint32_t>* bits : {&marks_, &ranks_}) *bits = device_.array<uint32_t>(std::max<size_t>(1, words));
  rowIds_ = device_.array<uint32_t>(texelCapacity_);
  weights_ = device_.array<float>(kTexelsPerHit * hits);
  texelPositions_ = device_.array<float>(size_t{3} * texelCapacity_);
  for (Array<float>* perTexel : {&stored_, &storedGradients_})
    *perTexel = device_.array<float>(size_t{kStored} * texelCapacity_);
  featureGradients_ = device_.array<float>(size_t{kStoredFeatures} * texelCapacity_);
  for (Array<float>* perHit : {&opacities_, &opacityGradients_, &sampleWeights_, &weightGradients_})
    *perHit = device_.array<float>(hits);
  for (Array<float>* perHit : {&colourGradients_, &ditherGradients_}) *perHit = device_.array<float>(3 * hits);
  opacity_ = device_.array<float>(maxRays);
  for (Array<float>* perRay : {&colour_, &skyColour_, &ditherColourGradients_})
    *perRay = device_.array<float>(size_t{3} * maxRays);
  if (level > 0) features_ = device_.array<float>(size_t{kStoredFeatures} * texelCapacity_);
  model.field().reserve(texelCapacity_);
}

Matrix<float> AtlasStage::encodedFeatures() {
  return level_ == 0 ? model_.field().encodedFeatures() : Matrix<float>(features_, kStoredFeatures);
}

void AtlasStage::addGradients(const PhotoRays& rays, uint32_t count, PhotoLoss& photoLoss, Slice<float> losses,
                              Slice<uint32_t> counters) {
  MeshField& field = model_.field();
  hits_.counters = counters.part(0, MeshHits::kCounters);
  Step step{rays,
            count,
            hits_.samples(),
            {texelCapacity_, counters.part(MeshHits::kCounters, 1)},
            hits_.finished(count),
            counters.part(MeshHits::kCounters, 1),
            rays.directions(0, count),
            losses};
  model_.level(level_).trace({count, rays.origins(0, count), step.directions, {}}, kMaxAtlasHits, false, hits_);
  lookUp(step);
  step.colours = field.decode(step.hits, step.directions, hits_.rayOfSample);
  composite(step, photoLoss);

  const Matrix<const float> featureGradients =
      field.decodeBackward(step.hits, Matrix<const float>(colourGradients_, 3), level_ == 0);
  const Matrix<float> storedGradients(storedGradients_, kStored);
  device_.fillZero(storedGradients_.all());
  const auto mixBack = [&](const Matrix<const float>& gradients, const Matrix<float>& to) {
    device_.run(MixRowsBackward{step.hits, kTexelsPerHit, step.texels, rows_, weights_, gradients, to});
  };
  mixBack(featureGradients, storedGradients.columnRange(0, kStoredFeatures));
  mixBack(Matrix<const float>(opacityGradients_, 1), storedGradients.columnRange(kStoredFeatures, 1));
  StoreTexelsBackward back;
  back.rows = step.texels;
  back.offset = model_.opacityOffset();
  back.features = encodedFeatures();
  back.ranges = ranges_;
  back.storedGradients = storedGradients;
  back.featureGradients = Matrix<float>(featureGradients_, kStoredFeatures);
  device_.run(back);
  if (level_ == 0) {
    field.encodeBackward(step.texels, texelPositions_, back.featureGradients);
  } else {
    device_.run(ScatterRows{step.texels, rowIds_, back.featureGradients,
                            Matrix<float>(model_.coarseAtlas(level_)->texels.gradients, kStoredFeatures)});
  }
}

// Evaluates the encoder at the texels that the hits need, and mixes these for each hit.
void AtlasStage::lookUp(const Step& step) {
  MeshField& field = model_.field();
  PatchTexels look;
  look.samples = step.hits;
  look.patchEdge = atlas_.patchEdge();
  look.patchOfFace = atlas_.patchOfFace();
  look.faces = hits_.faces;
  look.barycentrics = hits_.barycentrics;
  look.cornerFactors = atlas_.cornerFactors();
  look.texels = texels_;
  look.weights = weights_;
  device_.run(look);
  DistinctRows distinct;
  distinct.samples = step.hits;
  distinct.perSample = kTexelsPerHit;
  distinct.ids = texels_;
  distinct.idCount = atlas_.texels();
  distinct.rowCapacity = texelCapacity_;
  distinct.marks = marks_;
  distinct.ranks = ranks_;
  distinct.rowIds = rowIds_;
  distinct.rows = rows_;
  distinct.rowCount = step.texelCounter;
  device_.run(distinct);
  if (level_ == 0) {
    device_.run(GatherRows{step.texels, rowIds_, atlas_.positions(), Matrix<float>(texelPositions_, 3)});
    field.encodeForBackward(step.texels, texelPositions_);
  } else {
    device_.run(GatherRows{step.texels, rowIds_,
                           Matrix<const float>(model_.coarseAtlas(level_)->texels.values.all(), kStoredFeatures),
                           encodedFeatures()});
  }
  StoreTexelsForward store;
  store.rows = step.texels;
  store.offset = model_.opacityOffset();
  store.opaqueFrom = StoredOpacity::kOpaqueFrom;
  store.transparentBelow = StoredOpacity::kTransparentBelow;
  store.features = encodedFeatures();
  store.ranges = ranges_;
  store.stored = Matrix<float>(stored_, kStored);
  device_.run(store);
  const auto mix = [&](const Matrix<float>& from, const Matrix<float>& to) {
    device_.run(MixRowsForward{step.hits, kTexelsPerHit, step.texels, rows_, weights_, from, to});
  };
  mix(store.stored.columnRange(0, kStoredFeatures), field.decoderFeatures());
  mix(store.stored.columnRange(kStoredFeatures, 1), Matrix<float>(opacities_, 1));
}

// Composites the hits, and sets the gradients of their colours and opacities.
void AtlasStage::composite(const Step& step, PhotoLoss& photoLoss) {
  CompositeForward composite;
  composite.extinction = Extinction::opacity;
  composite.minTransmittance = 1e-4f;
  composite.rays = step.finished;
  composite.firstSample = hits_.firstSample;
  composite.x = Matrix<const float>(opacities_, 1);
  composite.colours = step.colours;
  composite.colour = colour_;
  composite.opacity = opacity_;
  composite.weights = sampleWeights_;
  const bool hasSky = model_.part().isBackground();
  if (hasSky) {
    device_.run(
        CubeMapForward{MeshModel::kSkyResolution, step.finished, step.directions, model_.sky().values, skyColour_});
    composite.background = skyColour_;
  }
  device_.run(composite);
  PhotoLoss::Picture picture{step.finished, 0, step.count, colour_.part(0, size_t{3} * step.count),
                             opacity_.part(0, step.count)};
  picture.standsBeforeBackgrounds = !hasSky;
  picture.trainsExposures = false;
  photoLoss.compare(step.rays, picture, step.losses.part(0, PhotoLoss::kLosses));
  photoLoss.passBack(step.rays, picture);
  if (hasSky) {
    device_.run(CubeMapBackward{MeshModel::kSkyResolution, step.finished, step.directions, opacity_,
                                photoLoss.colourGradients(picture), model_.sky().gradients});
  }

  DitherLoss dither;
  dither.scale = static_cast<float>(kDitherWeight / (3.0 * step.count));
  dither.rays = step.finished;
  dither.rayWeights = step.rays.weights(0, step.count);
  dither.firstSample = hits_.firstSample;
  dither.weights = sampleWeights_;
  dither.colours = step.colours;
  dither.colour = colour_;
  dither.opacity = opacity_;
  if (hasSky) dither.background = skyColour_;
  dither.loss = step.losses.part(PhotoLoss::kLosses, 1);
  dither.weightGradients = weightGradients_;
  dither.colourGradients = Matrix<float>(ditherGradients_, 3);
  dither.rayColourGradients = photoLoss.colourGradients(picture);
  dither.rayOpacityGradients = photoLoss.opacityGradients(picture);
  device_.fillZero(ditherGradients_.all());
  device_.run(dither);

  CompositeBackward back;
  back.extinction = composite.extinction;
  back.minTransmittance = composite.minTransmittance;
  back.rays = step.finished;
  back.firstSample = hits_.firstSample;
  back.x = composite.x;
  back.colours = composite.colours;
  back.background = composite.background;
  back.rayColourGradients = photoLoss.colourGradients(picture);
  back.rayOpacityGradients = photoLoss.opacityGradients(picture);
  back.weightGradients = weightGradients_;
  back.xGradients = opacityGradients_;
  back.colourGradients = Matrix<float>(colourGradients_, 3);
  device_.run(back);
  device_.run(AddColumns{step.hits, Matrix<const float>(ditherGradients_, 3), back.colourGradients});
}

}  // namespace tessera
