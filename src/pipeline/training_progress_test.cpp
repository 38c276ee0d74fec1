#include "pipeline/training_progress.h"

#include <gtest/gtest.h>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(TrainingProgresses, AreThoseOfTheManifest) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& text) {
    writeFileAtomically(folder / "manifest.json", text);
    return readTrainingProgress(folder.path());
  };
  EXPECT_EQ(readTrainingProgress(folder / "absent").step, 0);
  const TrainingProgress planned = read(R"({"step": 30, "planned_steps": 120})");
  EXPECT_EQ(planned.step, 30);
  EXPECT_EQ(planned.plannedSteps, 120);
  EXPECT_EQ(planned.seconds, 0);
  EXPECT_EQ(read(R"({"step": 30, "planned_steps": 0, "seconds": 7.5})").seconds, 7.5);
  for (const char* damaged : {"", "[", "3", R"({"step": "x", "planned_steps": [], "seconds": -1})"}) {
    EXPECT_EQ(read(damaged).step, 0) << damaged;
    EXPECT_EQ(read(damaged).seconds, 0) << damaged;
  }
}

TEST(RaysPerSecond, AreThoseOfTheLastLines) {
  const TemporaryFolder folder;
  EXPECT_EQ(readRaysPerSecond(folder.path()), 0);
  std::string lines;
  for (int i = 1; i <= 1000; ++i) lines += R"({"step": 1, "rays_per_second": )" + std::to_string(10 * i) + "}\n";
  lines += R"({"rays_per_second": 1e9})"
           "\n";  // of a window in which little was done
  writeFileAtomically(folder / "metrics.jsonl", lines);
  EXPECT_EQ(readRaysPerSecond(folder.path()), 9990);
  for (const char* damaged :
       {"", "{\n[", R"({"rays_per_second": "x"})", R"({"rays_per_second": -1})", "{\"step\": 1}\n{"}) {
    writeFileAtomically(folder / "metrics.jsonl", std::string(damaged));
    EXPECT_EQ(readRaysPerSecond(folder.path()), 0) << damaged;
  }
}

}  // namespace
}  // namespace tessera
