#include "base/safetensors.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>

#include "base/error.h"

namespace tessera {
namespace {

Bytes encodeFile(const std::string& header, size_t dataBytes, std::optional<uint64_t> claimed = {}) {
  const uint64_t length = claimed.value_or(header.size());
  Bytes bytes(8 + header.size() + dataBytes);
  std::memcpy(bytes.data(), &length, 8);
  std::memcpy(bytes.data() + 8, header.data(), header.size());
  for (size_t i = 0; i < dataBytes; ++i) bytes[8 + header.size() + i] = static_cast<std::byte>(i);
  return bytes;
}

template <class T>
TensorView makeTensorView(TensorType type, std::vector<int64_t> shape, const std::vector<T>& values) {
  return {type, std::move(shape), std::as_bytes(std::span(values))};
}

TEST(Safetensors, ReadsBackWhatItWrote) {
  const std::vector<float> weights = {1.5f, -2.0f, 3.0f, 0.0f, 1e-30f, 7.0f};
  const std::vector<uint8_t> odd = {1, 2, 3};
  const std::vector<double> wide = {0.1};
  const Bytes bytes = encodeSafetensors({{"a.odd", makeTensorView(TensorType::u8, {3}, odd)},
                                         {"weights", makeTensorView(TensorType::f32, {2, 3}, weights)},
                                         {"scalar", makeTensorView(TensorType::f64, {}, wide)},
                                         {"none", makeTensorView(TensorType::i32, {0, 4}, std::vector<int>{})}},
                                        {{"step", "12"}});
  const auto file = decodeSafetensors(bytes);
  ASSERT_TRUE(file);
  EXPECT_EQ(file->metadata.at("step"), "12");
  ASSERT_EQ(file->tensors.size(), 4u);
  const TensorView& read = file->require("x", "weights", TensorType::f32);
  EXPECT_EQ(read.shape, (std::vector<int64_t>{2, 3}));
  EXPECT_EQ(read.elements(), 6);
  EXPECT_TRUE(std::equal(weights.begin(), weights.end(), read.as<float>().begin()));
  EXPECT_EQ(file->tensors.at("scalar").as<double>()[0], 0.1);
  EXPECT_EQ(file->tensors.at("a.odd").as<uint8_t>()[2], 3);
  EXPECT_EQ(file->tensors.at("none").elements(), 0);
}

TEST(Safetensors, GivesTheSameBytesForTheSameContentWithoutHoles) {
  const std::vector<float> values = {1, 2};
  const std::vector<uint8_t> odd = {9};
  const std::map<std::string, TensorView> tensors = {{"b", makeTensorView(TensorType::f32, {2}, values)},
                                                     {"a", makeTensorView(TensorType::u8, {1}, odd)}};
  const Bytes bytes = encodeSafetensors(tensors);
  EXPECT_EQ(bytes, encodeSafetensors(tensors));
  uint64_t header = 0;
  std::memcpy(&header, bytes.data(), 8);
  EXPECT_EQ(header % 8, 0u);
  EXPECT_EQ(bytes.size(), 8 + header + 9);  // readers of the format reject gaps
}

TEST(Safetensors, SurvivesBeingMoved) {
  const std::vector<float> values = {4, 5};
  auto file = decodeSafetensors(encodeSafetensors({{"v", makeTensorView(TensorType::f32, {2}, values)}}));
  ASSERT_TRUE(file);
  const Safetensors moved = std::move(*file);
  EXPECT_EQ(moved.tensors.at("v").as<float>()[1], 5.0f);
}

TEST(Safetensors, CopiesMisalignedTensorsToAnAlignedPlace) {
  // The data starts at an odd offset, and "f" lies one byte into it.
  std::string header =
      R"({"u":{"dtype":"U8","shape":[1],"data_offsets":[0,1]},"f":{"dtype":"F32","shape":[2],"data_offsets":[1,9]}})";
  while ((8 + header.size()) % 4 != 0) header += ' ';
  const auto file = decodeSafetensors(encodeFile(header, 9));
  ASSERT_TRUE(file);
  const TensorView& f = file->tensors.at("f");
  EXPECT_EQ(reinterpret_cast<uintptr_t>(f.bytes.data()) % 4, 0u);
  for (size_t i = 0; i < 8; ++i) EXPECT_EQ(f.bytes[i], static_cast<std::byte>(i + 1));
  EXPECT_EQ(file->tensors.at("u").as<uint8_t>()[0], 0);
}

TEST(Safetensors, RefusesAbsurdHeaderSizes) {
  EXPECT_FALSE(decodeSafetensors({}));
  EXPECT_FALSE(decodeSafetensors(Bytes(7)));
  for (const uint64_t claimed : {uint64_t{3}, uint64_t{1} << 40, UINT64_MAX, UINT64_MAX - 7, uint64_t{101} << 20}) {
    EXPECT_FALSE(decodeSafetensors(encodeFile("{}", 0, claimed))) << claimed;
  }
  EXPECT_TRUE(decodeSafetensors(encodeFile("{}", 0)));
}

TEST(Safetensors, RefusesOffsetsThatOverlap) {
  EXPECT_FALSE(decodeSafetensors(encodeFile(
      R"({"a":{"dtype":"U8","shape":[4],"data_offsets":[0,4]},"b":{"dtype":"U8","shape":[4],"data_offsets":[3,7]}})",
      8)));
  EXPECT_FALSE(decodeSafetensors(encodeFile(
      R"({"a":{"dtype":"U8","shape":[8],"data_offsets":[0,8]},"b":{"dtype":"U8","shape":[2],"data_offsets":[3,5]}})",
      8)));
  EXPECT_TRUE(decodeSafetensors(encodeFile(
      R"({"a":{"dtype":"U8","shape":[4],"data_offsets":[0,4]},"b":{"dtype":"U8","shape":[4],"data_offsets":[4,8]}})",
      8)));
}

TEST(Safetensors, RefusesOffsetsAndShapesThatDisagreeWithTheData) {
  for (const char* tensor :
       {R"({"dtype":"F32","shape":[2],"data_offsets":[0,4]})",                     // too short for its shape
        R"({"dtype":"F32","shape":[1],"data_offsets":[4,0]})",                     // backwards
        R"({"dtype":"F32","shape":[4],"data_offsets":[0,16]})",                    // beyond the end
        R"({"dtype":"F32","shape":[-1],"data_offsets":[0,4]})",                    // negative
        R"({"dtype":"F32","shape":[4611686018427387905],"data_offsets":[0,4]})",   // wraps to 4 bytes
        R"({"dtype":"U8","shape":[4294967296,4294967296],"data_offsets":[0,0]})",  // wraps to 0 bytes
        R"({"dtype":"F32","shape":[1.0],"data_offsets":[0,4]})",                   // not an integer
        R"({"dtype":"BF13","shape":[1],"data_offsets":[0,4]})",                    // unknown type
        R"({"dtype":4,"shape":[1],"data_offsets":[0,4]})", R"({"shape":[1]})", R"([])", R"("x")"}) {
    EXPECT_FALSE(decodeSafetensors(encodeFile(std::string(R"({"t":)") + tensor + "}", 8))) << tensor;
  }
}

TEST(Safetensors, RefusesHeadersThatAreNotAnObject) {
  for (const char* header :
       {"", "[]", "{", "null", "{\"__metadata__\":3}", "{\"__metadata__\":{\"a\":1}}", "\xff\xfe"}) {
    EXPECT_FALSE(decodeSafetensors(encodeFile(header, 0))) << header;
  }
  EXPECT_FALSE(decodeSafetensors(encodeFile(std::string(100000, '['), 0)));
}

TEST(Safetensors, NamesMissingTensorsAndWrongTypes) {
  const std::vector<float> values = {1};
  const auto file = decodeSafetensors(encodeSafetensors({{"w", makeTensorView(TensorType::f32, {1}, values)}}));
  ASSERT_TRUE(file);
  EXPECT_THROW(file->require("m.safetensors", "v", TensorType::f32), Error);
  try {
    file->require("m.safetensors", "w", TensorType::f16);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("m.safetensors: w: the tensor holds F32 where F16"), std::string::npos)
        << error.what();
  }
}

TEST(Safetensors, NamesAFileThatIsNotOne) {
  const fs::path path = fs::temp_directory_path() / ("tessera_not_safetensors_" + std::to_string(::getpid()));
  writeFileAtomically(path, std::string_view("nonsense, but long enough"));
  EXPECT_THROW(readSafetensors(path), Error);
  fs::remove(path);
}

}  // namespace
}  // namespace tessera
