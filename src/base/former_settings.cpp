#include "base/former_settings.h"

namespace tessera {
namespace {

struct FormerName {
  std::string_view before, now;
};

constexpr FormerName kFormerNames[] = {
    {"constant_rate_share", "constant_learning_rate_fraction"},
    {"deferred_rate_factor", "deferred_learning_rate_factor"},
    {"depth", "depth_weight"},
    {"distortion", "distortion_weight"},
    {"exposure_rate", "exposure_learning_rate"},
    {"fewest_samples", "min_samples_per_ray"},
    {"final_rate_factor", "final_learning_rate_factor"},
    {"fine_rate_factor", "fine_learning_rate_factor"},
    {"free_space", "near_from_sparse_depth"},
    {"frozen_share", "deferred_only_fraction"},
    {"interlevel", "interlevel_weight"},
    {"known_bracket", "sparse_depth_margin"},
    {"known_share", "sparse_depth_ray_fraction"},
    {"level", "lod"},
    {"level_padding", "lod_uniform_sample_fraction"},
    {"level_rate_factor", "lod_learning_rate_factor"},
    {"level_share", "lod_step_fraction"},
    {"levels", "fine_levels"},
    {"most_rays", "max_rays"},
    {"occupancy_share", "occupancy_update_fraction"},
    {"occupancy_warm_up", "occupancy_warmup_steps"},
    {"opacity", "opacity_weight"},
    {"padding", "uniform_sample_fraction"},
    {"proposal_warm_up", "proposal_warmup_steps"},
    {"ramp_share", "loss_warmup_fraction"},
    {"rate", "learning_rate"},
    {"rate_fall", "learning_rate_schedule"},
    {"s3im", "s3im_weight"},
    {"samples_per_pass", "samples_per_micro_batch"},
    {"shortest_step", "min_ray_step_ratio"},
    {"sparsity", "sparsity_weight"},
    {"step", "max_ray_step"},
    {"step_change", "ray_step_change"},
    {"surround", "background_block"},
    {"warm_up_steps", "warmup_steps"},
};

}  // namespace

std::string_view currentSettingName(std::string_view key) {
  for (const FormerName& name : kFormerNames) {
    if (name.before == key) return name.now;
  }
  return {};
}

}  // namespace tessera
