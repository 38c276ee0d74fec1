#include "pipeline/training_planner.h"

#include <gtest/gtest.h>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(TrainingPlanner, NeedsTheDiskThatAnInterruptedCaptureDoesNotTakeYet) {
  const TemporaryFolder folder;
  PhotoRunOptions options;
  options.out = folder.path();
  const TrainingSize size{
      .photos = 10, .photoPixels = 1000, .sourcePixels = 1000, .longerSide = 40, .sourceBytes = 5000, .minutes = 1};
  TrainingPlanner planner(options, {[&] { return size; }, [] { return std::nullopt; }, [] { return 1; }, false});
  const auto diskBytes = [&](bool resumes) { return planner.captureNeeds(resumes).diskBytes; };
  EXPECT_EQ(diskBytes(true), 5000);
  writeFileAtomically(folder / "capture/images/a.jpg", std::string(1200, 'a'));
  writeFileAtomically(folder / "capture/points.ply", std::string(300, 'a'));
  EXPECT_EQ(diskBytes(true), 3500);
  EXPECT_EQ(diskBytes(false), 5000) << "of another size, whose files need not replace these";
  writeFileAtomically(folder / "capture/points.ply", std::string(9000, 'a'));
  EXPECT_EQ(diskBytes(true), 0);
}

}  // namespace
}  // namespace tessera
