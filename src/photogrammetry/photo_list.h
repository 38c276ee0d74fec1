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
  // Photos of one size by one lens on one camera, at any focal length, without a long pause between them, or in one
  // folder if times are unknown.
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

inline constexpr double kPauseBetweenFlights = 300;  // seconds

// Lists the JPEG and PNG files below a folder. Leaves out files that cannot be read, photos in other formats, copies of
// other photos, panoramas, and infrared pictures beside visible ones. Hidden files and folders are ignored. Throws
// Error if the folder cannot be read.
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
