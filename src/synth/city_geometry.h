// From the plan of a city to triangles.
#pragma once

#include "synth/layout.h"
#include "synth/surface_mesh.h"

namespace tessera {

// Everything that does not move.
SurfaceMesh buildCity(const CityLayout& city);

void addGround(const CityLayout& city, SurfaceMesh& mesh);      // terrain, blocks, kerbs, water
void addBuilding(const Building& building, SurfaceMesh& mesh);  // walls, balconies, awnings, roof
void addRoof(const Building& building, SurfaceMesh& mesh);
void addTree(const Tree& tree, float ground, SurfaceMesh& mesh);
void addStreetFurniture(const CityLayout& city, SurfaceMesh& mesh);  // lamps, poles and their wires

// A car standing on `foot`, facing `yaw`; colour and size from the seed.
void addCar(const Vec3f& foot, float yaw, uint32_t seed, SurfaceMesh& mesh);

// The cars under way at one moment. Lanes and speeds are a function of the city; `seconds` moves them.
SurfaceMesh buildTraffic(const CityLayout& city, double seconds);

}  // namespace tessera
