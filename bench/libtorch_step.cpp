// The training step of `tessera bench train`, composed of libtorch's CPU operations the way a careful user would: the
// same model (hash grid 16 x 2, T = 2^17; density 32-64-16; colour 32-64-64-3; spherical harmonics of degree 4), the
// same batch shape (2048 rays of 32 samples), Huber loss, backward pass, Adam. Indices and trilinear weights are
// computed without autograd. The sum over a cell's corners is implemented in three ways, of which the fastest counts.
//
//   libtorch_step [seconds per variant]

#include <dlfcn.h>
#include <torch/torch.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

namespace {

using torch::Tensor;
namespace functional = torch::nn::functional;

constexpr int kLevels = 16, kFeatures = 2, kLog2Entries = 17, kBase = 16, kFinest = 2048;
constexpr int64_t kRays = 2048, kPerRay = 32, kSamples = kRays * kPerRay;
constexpr float kStep = 0.05f;

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct Level {
  float scale;
  int64_t resolution, entries, first;
  bool hashed;
};

std::vector<Level> makeLevels() {
  std::vector<Level> levels;
  const double growth = std::pow(static_cast<double>(kFinest) / kBase, 1.0 / (kLevels - 1));
  int64_t first = 0;
  for (int l = 0; l < kLevels; ++l) {
    const double scale = kBase * std::pow(growth, l) - 1;
    const int64_t resolution = static_cast<int64_t>(std::ceil(scale - 1e-6)) + 1, maximum = int64_t{1} << kLog2Entries;
    const int64_t dense = (resolution * resolution * resolution + 7) / 8 * 8;
    levels.push_back({static_cast<float>(scale), resolution, std::min(dense, maximum), first, dense > maximum});
    first += levels.back().entries;
  }
  return levels;
}

// Computes indices [samples, 8] into the table of all levels, and trilinear weights. int32 wraps around as the hash
// requires.
void findCorners(const Level& level, const Tensor& positions, Tensor& index, Tensor& weight) {
  const Tensor at = positions * level.scale + 0.5f, floor = at.floor(), t = at - floor, cell = floor.to(torch::kInt);
  const int32_t primeY = level.hashed ? static_cast<int32_t>(2654435761u) : static_cast<int32_t>(level.resolution);
  const int32_t primeZ = level.hashed ? 805459861 : static_cast<int32_t>(level.resolution * level.resolution);
  const Tensor x0 = cell.select(1, 0), y0 = cell.select(1, 1) * primeY, z0 = cell.select(1, 2) * primeZ;
  const Tensor xs[2] = {x0, x0 + 1}, ys[2] = {y0, y0 + primeY}, zs[2] = {z0, z0 + primeZ};
  const Tensor tx = t.select(1, 0), ty = t.select(1, 1), tz = t.select(1, 2);
  const Tensor wx[2] = {1 - tx, tx}, wy[2] = {1 - ty, ty}, wz[2] = {1 - tz, tz};
  for (int yz = 0; yz < 4; ++yz) {
    const Tensor& y = ys[yz & 1];
    const Tensor& z = zs[yz >> 1];
    const Tensor far = level.hashed ? y.bitwise_xor(z) : y + z, w = wy[yz & 1] * wz[yz >> 1];
    for (int x = 0; x < 2; ++x) {
      Tensor i = level.hashed ? far.bitwise_xor(xs[x]).bitwise_and_(static_cast<int32_t>(level.entries - 1))
                              : (far + xs[x]).remainder_(static_cast<int32_t>(level.entries));
      index.select(1, 2 * yz + x).copy_(i.add_(static_cast<int32_t>(level.first)));
      weight.select(1, 2 * yz + x).copy_(w * wx[x]);
    }
  }
}

Tensor harmonics(const Tensor& d) {
  const Tensor x = d.select(1, 0), y = d.select(1, 1), z = d.select(1, 2);
  const Tensor xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
  return torch::stack({torch::full_like(x, 0.28209479f), -0.48860251f * y, 0.48860251f * z, -0.48860251f * x,
                       1.0925484f * xy, -1.0925484f * yz, 0.94617470f * zz - 0.31539157f, -1.0925484f * xz,
                       0.54627422f * (xx - yy), 0.59004359f * y * (yy - 3 * xx), 2.8906114f * xy * z,
                       0.45704580f * y * (1 - 5 * zz), 0.37317633f * z * (5 * zz - 3), 0.45704580f * x * (1 - 5 * zz),
                       1.4453057f * z * (xx - yy), 0.59004359f * x * (3 * yy - xx)},
                      1);
}

enum class Gather { indexSelect, embedding, embeddingBag };
const char* kGatherNames[] = {"index_select", "embedding", "embedding_bag"};

class Step {
 public:
  explicit Step(Gather gather) : gather_(gather), levels_(makeLevels()) {
    torch::manual_seed(1);
    const auto uniform = [](std::vector<int64_t> sizes, double bound) {
      return ((torch::rand(sizes) * 2 - 1) * bound).requires_grad_(true);
    };
    const auto xavier = [&](int64_t outputs, int64_t inputs) {
      return uniform({outputs, inputs}, std::sqrt(6.0 / static_cast<double>(outputs + inputs)));
    };
    table_ = uniform({levels_.back().first + levels_.back().entries, kFeatures}, 1e-4);
    weights_ = {xavier(64, kLevels * kFeatures), xavier(16, 64), xavier(64, 32), xavier(64, 64), xavier(3, 64)};
    const Tensor directions = functional::normalize(torch::randn({kRays, 3}));
    const Tensor along = torch::arange(kPerRay).to(torch::kFloat) * (std::sqrt(3.0) / 1024);
    positions_ = (torch::rand({kRays, 1, 3}) + directions.unsqueeze(1) * along.view({1, kPerRay, 1}))
                     .clamp(0, 1)
                     .view({kSamples, 3})
                     .contiguous();
    directions_ = directions;
    targets_ = torch::rand({kRays, 3});
    for (int l = 0; l < kLevels; ++l) {
      indices_.push_back(torch::empty({kSamples, 8}, torch::kInt));
      corners_.push_back(torch::empty({kSamples, 8}));
    }
    bags_ = torch::arange(0, kSamples * 8, 8, torch::kInt);
    std::vector<Tensor> parameters = weights_;
    parameters.push_back(table_);
    adam_ =
        std::make_unique<torch::optim::Adam>(parameters, torch::optim::AdamOptions(1e-4).betas({0.9, 0.99}).eps(1e-15));
  }

  double run() {
    {
      const torch::NoGradGuard noGrad;
      for (int l = 0; l < kLevels; ++l) findCorners(levels_[l], positions_, indices_[l], corners_[l]);
    }
    std::vector<Tensor> encoded;
    for (int l = 0; l < kLevels; ++l) encoded.push_back(mix(indices_[l], corners_[l]));
    const Tensor geometry = torch::relu(torch::cat(encoded, 1).matmul(weights_[0].t())).matmul(weights_[1].t());
    const Tensor perRay = harmonics(directions_).unsqueeze(1).expand({kRays, kPerRay, 16}).reshape({kSamples, 16});
    const Tensor hidden = torch::relu(torch::cat({geometry, perRay}, 1).matmul(weights_[2].t()));
    const Tensor colours = torch::sigmoid(torch::relu(hidden.matmul(weights_[3].t())).matmul(weights_[4].t()));
    const Tensor thickness = geometry.select(1, 0).clamp(-15, 15).exp().view({kRays, kPerRay}) * kStep;
    const Tensor before = thickness.cumsum(1) - thickness;
    const Tensor weight = torch::exp(-before) * (1 - torch::exp(-thickness));
    const Tensor picture = (weight.unsqueeze(2) * colours.view({kRays, kPerRay, 3})).sum(1);
    const Tensor loss = functional::smooth_l1_loss(picture, targets_,
                                                   functional::SmoothL1LossFuncOptions().reduction(torch::kMean), 0.1);
    adam_->zero_grad();
    loss.backward();
    adam_->step();
    return loss.item<double>();
  }

 private:
  Tensor mix(const Tensor& index, const Tensor& corner) const {
    if (gather_ == Gather::embeddingBag) {
      functional::EmbeddingBagFuncOptions options;
      options.offsets(bags_).mode(torch::kSum).per_sample_weights(corner.view(-1));
      return functional::embedding_bag(index.view(-1), table_, options);
    }
    const Tensor entries = gather_ == Gather::embedding
                               ? torch::embedding(table_, index)
                               : table_.index_select(0, index.view(-1)).view({kSamples, 8, kFeatures});
    return (entries * corner.unsqueeze(2)).sum(1);
  }

  Gather gather_;
  std::vector<Level> levels_;
  Tensor table_, positions_, directions_, targets_, bags_;
  std::vector<Tensor> weights_, indices_, corners_;
  std::unique_ptr<torch::optim::Adam> adam_;
};

double gemmRate(int64_t rows, int64_t depth, int64_t columns) {
  const Tensor a = torch::rand({rows, depth}), b = torch::rand({depth, columns});
  Tensor c = torch::empty({rows, columns});
  double best = 1e30;
  for (int i = 0; i < 15; ++i) {
    const double start = now();
    torch::mm_out(c, a, b);
    best = std::min(best, now() - start);
  }
  return 2.0 * static_cast<double>(rows * depth * columns) / best;
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 4;
  at::set_num_threads(2);
  using CoreName = char* (*)();
  const auto coreName = reinterpret_cast<CoreName>(dlsym(RTLD_DEFAULT, "openblas_get_corename"));
  const char* requested = std::getenv("OPENBLAS_CORETYPE");
  std::printf("libtorch %s, %d threads, BLAS %s, OPENBLAS_CORETYPE %s\n", TORCH_VERSION, at::get_num_threads(),
              coreName ? (std::string("OpenBLAS ") + coreName()).c_str() : "not OpenBLAS",
              requested ? requested : "not set");
  std::printf("gemm 1024x1024x1024      %7.1f GFLOP/s\n", gemmRate(1024, 1024, 1024) / 1e9);
  std::printf("gemm 65536x64x64         %7.1f GFLOP/s\n", gemmRate(65536, 64, 64) / 1e9);
  double bestRate = 0;
  for (const Gather gather : {Gather::indexSelect, Gather::embedding, Gather::embeddingBag}) {
    Step step(gather);
    const double first = step.run();
    double loss = step.run(), spent = 0;
    std::vector<double> times;
    while (times.size() < 3 || spent < seconds) {
      const double start = now();
      loss = step.run();
      times.push_back(now() - start);
      spent += times.back();
    }
    std::nth_element(times.begin(), times.begin() + times.size() / 2, times.end());
    const double rate = kSamples / times[times.size() / 2];
    std::printf("step with %-14s %7.3f M samples/s, median %.0f ms of %zu (loss %.4f -> %.4f)\n",
                kGatherNames[static_cast<int>(gather)], rate / 1e6, 1e3 * times[times.size() / 2], times.size(), first,
                loss);
    bestRate = std::max(bestRate, rate);
  }
  std::printf("samples_per_second %.0f\n", bestRate);
  return 0;
}
