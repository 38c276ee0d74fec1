#include "representations/hash/vulkan/gpu_hash_content.h"

#include <bit>
#include <cmath>
#include <span>

#include "base/check.h"
#include "raymarch/vulkan/part_arguments.h"
#include "shaders/representations/hash/arguments_hash.h"

namespace tessera {
namespace {

// Appends the offsets and scales that dequantise numbers from 0 to `maximum`: first those of columns 1 2 3 0, then
// those of columns 4 5 6 7.
void addRangeVectors(std::span<const ByteRange> ranges, float maximum, std::vector<float>& numbers) {
  for (const std::array<int, 4>& columns : {std::array<int, 4>{1, 2, 3, 0}, {4, 5, 6, 7}}) {
    for (const int c : columns) numbers.push_back(ranges[c].low);
    for (const int c : columns) numbers.push_back((ranges[c].high - ranges[c].low) / maximum);
  }
}

float sigmoid(float x) {
  return 1 / (1 + std::exp(-x));
}

}  // namespace

GpuHashContent::GpuHashContent(const std::shared_ptr<GpuStream>& stream, const HashContent& content)
    : weights(content.weights),
      varies(content.columns() > HashPart::kFeatures),
      step(content.step),
      hasLearnedBackground(content.hasLearnedBackground),
      partCount(static_cast<uint32_t>(content.parts.size())),
      tables(static_cast<uint32_t>(content.parts.front().tables.size())),
      columns(content.columns()),
      layers(content.network) {
  const uint32_t each = content.logitsOfLevel();
  for (uint32_t level = 0; level < tables; ++level) {
    const bool weighed = each > 0 && !content.logits.empty();
    levelWeights[2 * level] = weighed ? sigmoid(content.logits[each * level]) : 1;
    levelWeights[2 * level + 1] = weighed ? sigmoid(content.logits[each * level + each - 1]) : 1;
  }
  PackedContent packed;
  std::vector<arguments::HashPartArguments> all;
  std::vector<float> numbers;  // the data of `vectors`
  for (const HashPart& part : content.parts) {
    CHECK(part.tables.size() == size_t{tables});
    auto partArguments = placedArguments<arguments::HashPartArguments>(part);
    partArguments.texels = static_cast<float>(part.cells());
    partArguments.lattice = static_cast<float>(part.lattice);
    partArguments.ratio = std::countr_zero(part.distances.ratio);
    partArguments.macroblocks = packed.add(part.macroblocks);
    partArguments.cornerWords = packed.add(part.cornerBytes);
    partArguments.coarse = packed.add(part.distances.coarse);
    partArguments.fine = packed.add(part.distances.fine);
    partArguments.firstVector = static_cast<uint32_t>(numbers.size() / 4);
    for (uint32_t first = 0; first < columns; first += HashPart::kFeatures) {
      addRangeVectors(std::span(part.ranges).subspan(first, HashPart::kFeatures), 1, numbers);
    }
    for (uint32_t level = 0; level < tables; ++level) {
      const HashTable& table = part.tables[level];
      partArguments.tables[level] = packed.add(table.bytes);
      numbers.insert(numbers.end(), {static_cast<float>(table.resolution), static_cast<float>(table.entries),
                                     table.hashed ? 1.0f : 0.0f, 0.0f});
      addRangeVectors(table.ranges, 255, numbers);
    }
    all.push_back(partArguments);
  }
  network = addNetwork(content.network, packed);
  vectors = packed.add(numbers);
  parts = packed.add(all);
  memory = GpuContentMemory(stream, packed.bytes().size());
  const uint64_t base = memory.address();
  for (arguments::HashPartArguments& part : all) {
    for (uint64_t* at : {&part.macroblocks, &part.cornerWords, &part.coarse, &part.fine}) *at += base;
    for (uint32_t level = 0; level < tables; ++level) part.tables[level] += base;
  }
  packed.replace(parts, all);
  memory.upload(packed);
  for (uint64_t* at : {&parts, &vectors, &network.layers, &network.weights}) *at += base;
}

}  // namespace tessera
