// Shared by the tests of imports: a source and a capture on disk.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "import/importer.h"
#include "import/testing/test_support.h"

namespace tessera {

// A nerfstudio folder with photos 0.png, ... of 16 × 12 pixels, taken along a line and looking north.
class Import : public testing::Test {
 protected:
  struct Frame {
    std::string file, more;
  };
  void SetUp() override {
    source_ = folder_ / "source";
    out_ = folder_ / "out";
    fs::create_directories(source_ / "images");
  }
  void add(const std::string& name, int width = 16, int height = 12, const std::string& more = "") {
    writePng(source_ / name, gradientPicture(width, height, 3, static_cast<int>(frames_.size())));
    frames_.push_back({name, more});
  }
  void write(const std::string& more = "") {
    std::string json = "{\"w\":16,\"h\":12,\"fl_x\":20" + more + ",\"frames\":[";
    for (size_t i = 0; i < frames_.size(); ++i) {
      json += std::string(i > 0 ? "," : "") + "{\"file_path\":\"" + frames_[i].file + "\"" + frames_[i].more +
              ",\"transform_matrix\":[[1,0,0," + std::to_string(1000 + i) + "],[0,0,-1,0],[0,1,0,2],[0,0,0,1]]}";
    }
    writeFileAtomically(source_ / "transforms.json", json + "]}");
  }
  Capture run(const ImportOptions& options = {}) {
    testing::internal::CaptureStderr();
    try {
      Capture capture = importCapture(source_, out_, options);
      log_ = testing::internal::GetCapturedStderr();
      return capture;
    } catch (...) {
      log_ = testing::internal::GetCapturedStderr();
      throw;
    }
  }
  bool logged(const std::string& text) const { return log_.find(text) != std::string::npos; }

  TemporaryFolder folder_;
  fs::path source_, out_;
  std::vector<Frame> frames_;
  std::string log_;
};

}  // namespace tessera
