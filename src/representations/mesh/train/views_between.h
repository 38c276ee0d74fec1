// Views between the photos, rendered by the coarse field: where few photos show each place, the parts of a mesh are
// trained on these, too. They keep what no photo looks at from where it is near the coarse field, which is smoother
// than the parts and knows unseen directions better. The paper, which has many photos of each place, has no such views.
#pragma once

#include "representations/field/train/field_model.h"
#include "representations/mesh/train/listed_folder.h"
#include "representations/mesh/train/stage_progress.h"
#include "scene/capture.h"

namespace tessera {

// Returns the number of training photos that show the place of a pixel, the median over all pixels, from what the
// middles of their tiles show of the coarse field; 0 if they show no surface.
double countPhotosOfPlace(const Capture& capture, FieldModel& coarse, const OnPhoto& onPhoto = kNobodyWatches);

// Returns the number of views that are missing for `enough` photos of each place, if each view counts as a photo; at
// most kMaxViewsPerPhoto for each of `photos`.
inline constexpr int kMaxViewsPerPhoto = 3;
size_t countMissingViews(size_t photos, double photosOfPlace, int enough);

// Returns the capture with `count` more training photos, without images, at the end. Each is between a training photo
// and one of its neighbours that looks in a similar direction, up to half of their distance beyond or beside them, with
// half of the photo's width and height. The same arguments give the same views.
Capture placeViewsBetween(Capture capture, size_t count, uint64_t seed);

// Renders the views of placeViewsBetween into the folder `views` of the model of a mesh, as many as are missing for
// `enough` photos. `onPhoto` counts the photos and these views. Other processes may write the same views at the same
// time. Throws Error if a file cannot be written.
void makeViewsBetween(const Capture& capture, FieldModel& coarse, const fs::path& mesh, int enough, uint64_t seed,
                      const OnPhoto& onPhoto = kNobodyWatches);
// The folder of these views; there may be none.
ListedFolder viewsFolder(const fs::path& mesh);

// Returns the capture with these views; unchanged if there are none. Throws Error if their list is malformed.
Capture addViewsBetween(Capture capture, const fs::path& mesh, uint64_t seed);

}  // namespace tessera
