// The photos of a folder, before anything is known of their poses: which can be used, which cameras took them, and in
// which flights.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"
#include "base/threads.h"
#include "import/exif.h"

namespace tessera {

// One lens on one camera, at one focal length and picture size: photos that share intrinsic parameters.
struct CameraBody {
  std::string name;  // "DJI FC300S, 1600x900"
  int width = 0, height = 0;
  double focalLength = 0;  // pixels, from EXIF; 0: unknown
};

struct ListedPhoto {
  std::string name;      // path below the folder, with '/'
  std::string safeName;  // unique, without folders and blanks, for programs that such names confuse
  fs::path file;
  int body = 0;  // index into PhotoList::bodies
  // Photos of one size by one lens on one camera, at any focal length, without a landing between them, or in one folder
  // if times are unknown.
  int flight = 0;
  PhotoTags tags;
  fs::path mask = {};  // black where the photo is not used (photo_masks.h); empty: none
};

struct LeftOutPhoto {
  std::string name, reason;
};

struct PhotoList {
  std::vector<CameraBody> bodies;
  std::vector<ListedPhoto> photos;  // in natural name order
  std::vector<LeftOutPhoto> leftOut;
  int flights = 0;
};

// A pause that begins another flight; and a shorter one that does so if the altitude from which the drone says that it
// took off jumps, as after its battery was exchanged.
inline constexpr double kPauseBetweenFlights = 300, kShortestLanding = 45;  // seconds
inline constexpr double kJumpBetweenFlights = 2;                            // metres

// Lists the JPEG and PNG files below a folder. Leaves out files that cannot be decoded or may not be opened, photos in
// other formats, copies of other photos (also smaller ones, by their name, time and place), panoramas, and infrared
// pictures beside visible ones. Hidden files and folders are ignored, and pictures in other formats beside photos of
// the same name. Throws Error if the folder or a file in it cannot be read for now.
PhotoList listPhotos(const fs::path& folder, ThreadPool& pool);

// Whether this is the name of a picture that is read: JPEG or PNG.
bool isPhotoName(const fs::path& path);

// Whether a name is UTF-8: only such names can be stored in a capture.
bool isUtf8(const std::string& name);

// Warns of the photos, once for each reason.
void warnLeftOut(const std::vector<LeftOutPhoto>& photos);

// Returns the focal length in pixels that the tags give for a picture of this width and height; 0 if they do not.
double focalLengthInPixels(const CameraTags& camera, int width, int height);

}  // namespace tessera
