#include "gpu/pipeline_cache.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "base/file.h"
#include "base/testing/temporary_folder.h"
#include "gpu/kernel.h"
#include "gpu/testing/test_context.h"
#include "shaders/double_values.h"

namespace tessera {
namespace {

class PipelineCacheTest : public testing::Test {
 protected:
  void SetUp() override {
    setenv("XDG_CACHE_HOME", folder_.path().c_str(), 1);
    const auto context = openForTest();
    SKIP_WITHOUT_VULKAN(context);
    VkPhysicalDeviceProperties properties = {};
    vkGetPhysicalDeviceProperties(context->physicalDevice(), &properties);
    file_ = PipelineCache::fileFor(properties);
  }
  void TearDown() override { unsetenv("XDG_CACHE_HOME"); }
  void compile() {
    const auto context = openForTest();
    const GpuKernel kernel(context, kDoubleValuesSpirv);
  }

  TemporaryFolder folder_;
  fs::path file_;
};

TEST_F(PipelineCacheTest, LiesInXdgCacheHome) {
  EXPECT_EQ(file_.parent_path(), folder_.path() / "tessera");
}

TEST_F(PipelineCacheTest, IsReusedAndSurvivesDamagedFiles) {
  compile();
  if (!fs::exists(file_)) GTEST_SKIP() << "this driver keeps nothing";
  const Bytes written = readFile(file_);
  compile();
  EXPECT_EQ(readFile(file_), written);  // nothing new to save
  for (const size_t length : {size_t{0}, size_t{7}, written.size() / 2, written.size() - 1}) {
    writeFileAtomically(file_, std::span(written).first(length));
    EXPECT_NO_THROW(compile()) << length;
  }
  Bytes damaged = written;
  damaged.back() ^= std::byte{1};
  writeFileAtomically(file_, damaged);
  EXPECT_NO_THROW(compile());
}

TEST_F(PipelineCacheTest, IgnoresAnUnwritableFolder) {
  fs::remove_all(file_.parent_path());
  writeFileAtomically(file_.parent_path(), "a file where the folder should be");
  EXPECT_NO_THROW(compile());
}

}  // namespace
}  // namespace tessera
