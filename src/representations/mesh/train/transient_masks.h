// The masks of what moves in the training photos of a mesh, in the folder `transient` of its model. They are made once,
// from the coarse field, and the same for all parts and processes.
#pragma once

#include "representations/field/train/field_model.h"
#include "representations/mesh/train/listed_folder.h"
#include "representations/mesh/train/stage_progress.h"
#include "representations/mesh/train/transient_pixels.h"
#include "scene/capture.h"

namespace tessera {

// The training photos of a capture beside the coarse field, in their order.
struct ComparedPhotos {
  std::vector<ComparedPhoto> photos;
  double pixelWidth = 0;  // on the surfaces that they show, the median, scene units
};
// Compares every second pixel along both axes, or fewer of large photos. Pixels that a mask excludes have no point.
// Throws Error if a photo or its mask cannot be read.
ComparedPhotos comparePhotos(const Capture& capture, FieldModel& coarse, const OnPhoto& onPhoto = kNobodyWatches);
// Returns the settings that suit these photos.
TransientSettings chooseTransientSettings(const ComparedPhotos& compared);

// Writes the masks of the training photos that show something transient, with what the photos' own masks exclude, and
// logs the share of what these do not exclude. `transients`: as findTransientPixels returns them, for the training
// photos in their order. Other processes may write the same masks at the same time. Throws Error if a photo's own mask
// cannot be read, or a file cannot be written.
void writeTransientMasks(const Capture& capture, const std::vector<ImageU8>& transients, const fs::path& mesh);
// Finds what is transient, and writes the masks. Throws Error as comparePhotos and writeTransientMasks do.
void makeTransientMasks(const Capture& capture, FieldModel& coarse, const fs::path& mesh,
                        const OnPhoto& onPhoto = kNobodyWatches);
// The folder of these masks.
ListedFolder transientFolder(const fs::path& mesh);

// Returns the capture with these masks in place of the photos' own; unchanged if there are none. Throws Error if their
// list is malformed.
Capture applyTransientMasks(Capture capture, const fs::path& mesh);

}  // namespace tessera
