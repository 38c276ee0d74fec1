// Every setting of the `mesh` representation: flag (`--set`), default, help and the line in config.toml.
#pragma once

#include "compute/octahedra.h"
#include "representations/mesh/train/mesh_field.h"
#include "representations/mesh/train/mesh_part.h"
#include "train/settings/blocks.h"
#include "train/settings/learning_rate.h"
#include "train/settings/losses.h"
#include "train/settings/networks.h"
#include "train/settings/rays.h"

namespace tessera {

struct MeshConfig : BackgroundBlockSettings,
                    PresetSettings,
                    RaySettings,
                    RandomBackgroundSettings,
                    SampleBudgetSettings,
                    HashGridSettings,
                    NetworkSettings,
                    HiddenLayerSettings,
                    LearningRateSettings,
                    PhotoLossSettings,
                    DistortionSettings,
                    DepthLossSettings {
  // Scene
  SETTING(int64_t, coarseSteps, 1500, "coarse_steps",
          "steps of the coarse field, which finds the surfaces that triangles start at; without --minutes",
          within(1, 1 << 30));
  SETTING(double, coarseShare, 0.15, "coarse_share", "share of --minutes for the coarse field", within(0.01, 0.9));
  SETTING(double, backgroundShare, 0.15, "background_share",
          "share of --minutes, at most, or of the steps, for the background block", within(0.01, 0.9));
  SETTING(std::string, transient, "none", "transient",
          "what moves between photos, such as cars: auto (the parts are not trained on pixels that deviate from what "
          "other photos show at the same place) or none (photos are used as they are)",
          anything());
  SETTING(
      int, enoughPhotos, 8, "enough_photos",
      "photos that should show each place: if fewer do in the median, the parts are also trained on views between the "
      "photos, rendered by the coarse field; 0, and without a background block: none",
      within(0, 64));
  // Model
  SETTING(int, gridFeatures, 2, "grid_features", "features per hash entry", allowedValues({1, 2, 4, 8}));
  SETTING(int, meshCells, 64, "mesh_cells", "cells along an edge of a block's grid of octahedra",
          within(8, 256).withDivisor(4, 0));
  SETTING(int, backgroundCells, 64, "background_cells",
          "cells along an edge of the region in the background block's grids of octahedra",
          within(8, 128).withDivisor(4, 0));
  SETTING(
      int, meshLevels, 5, "mesh_levels",
      "levels of detail, each with cells twice as wide as those of the next finer one; fewer if the number of cells "
      "cannot be halved so often",
      within(1, 5));
  SETTING(bool, everyCell, false, "every_cell",
          "every cell carries an octahedron, as the paper's text says; else every second one, so that none overlap",
          anything());
  SETTING(bool, quads, false, "quads",
          "a comparison: in place of octahedra, the quads of MobileNeRF's grid, four vertices around each edge of the "
          "lattice",
          anything());
  SETTING(double, opacityOffset, -6, "opacity_offset", "added to the logit of opacity; nearly transparent at the start",
          within(-20, 20));
  // Training
  SETTING(int, occupancyEvery, 16, "occupancy_every", "steps between updates of the occupancy", within(1, 1 << 30));
  SETTING(int, occupancyStartSteps, 256, "occupancy_start_steps", "steps before cells can become empty",
          within(0, 1 << 30));
  SETTING(double, occupancyDecay, 0.8, "occupancy_decay",
          "what remains of a cell's occupancy after an update unless a ray reaches a hit in it", share());
  SETTING(double, vertexLearningRate, 8e-3, "vertex_learning_rate",
          "learning rate of the vertices, in edges of a cell; falls to a hundredth", atLeast(0));
  SETTING(
      bool, coarseCells, true, "coarse_cells",
      "training starts with the cells of a block in which photos see the coarse field; else with all, which is slower",
      anything());
  SETTING(bool, surfaceStart, true, "surface_start",
          "vertices start where the coarse field has a surface in their cell; else in the middle of the cell",
          anything());
  SETTING(int, vertexStartSteps, 200, "vertex_start_steps", "steps before the vertices begin to move",
          within(0, 1 << 30));
  SETTING(double, minCosine, 0.1, "min_cosine",
          "a vertex is moved as if no ray hit its faces at a flatter angle than this cosine", share());
  SETTING(bool, opaqueLoss, true, "opaque_loss", "the second loss, which makes surfaces opaque", anything());
  SETTING(
      double, throughShare, 0.1, "through_share",
      "rays through a block that end behind it, at most, in addition to the others and relative to their number: they "
      "empty the space in front of surfaces; 0: none",
      share());
  SETTING(double, finalShare, 0.2, "final_share",
          "share of the steps for the final stage, which trains through texels as they are baked; 0: none",
          within(0, 0.9));
  SETTING(
      bool, fittedLevels, true, "fitted_levels",
      "the final stage fits the coarser levels to the finest one; else, and without a final stage, their vertices are "
      "trained with it",
      anything());
  SETTING(double, droppedShare, 0.0075, "dropped_share",
          "of what all triangles contribute to the rays of photos and those from above: the triangles with the least, "
          "which have this share together, are dropped",
          within(0, 0.5));
  SETTING(int, dilation, 0, "dilation",
          "how often the triangles beside those that rays see are added, if they are opaque enough, to close holes",
          within(0, 4));
  SETTING(int, patchTexels, 12, "patch_texels", "texels along the edge of a patch of two triangles",
          within(8, 32).withDivisor(4, 0));

  // Returns the settings of a preset; `paper` is meant for 80,000 steps. Throws Error if there is no preset of that
  // name.
  static MeshConfig ofPreset(const std::string& name);
  MeshConfig();
  // In the order of config.toml.
  std::vector<ConfigField> fields();
  // Throws Error that names the first invalid setting.
  void check() const;

  MeshFieldShape shape() const;
  // The number of levels: meshLevels, or as many as have a multiple of 4 cells along an edge, at least 8.
  uint32_t levels() const;
  bool leavesTransientsOut() const { return transient == "auto"; }
  bool hasBackground() const { return backgroundBlock == "own"; }
  // The number of steps before the final stage; 0 if the number of all is unknown.
  int64_t stepsBeforeFinalStage(int64_t plannedSteps) const;
  bool fitsLevels() const { return fittedLevels && finalShare > 0; }
  OctahedraDomain domain(const MeshPart& part, uint32_t level) const;
};

}  // namespace tessera
