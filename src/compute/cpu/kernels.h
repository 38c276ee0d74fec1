// The kernels of the cpu device, with one file per interface header. Each kernel divides its work into tasks whose
// inputs and outputs depend on the index of the task alone, and sums over tasks are taken in task order, so that the
// bits do not depend on the number of threads. The kernels are the functions run(Context&, const Operation&), which
// device.cpp declares.
#pragma once

#include <cstddef>

#include "base/threads.h"

namespace tessera::cpu {

struct Context {
  ThreadPool& pool;
};

const char* simdTarget();  // the instruction set chosen at run time: "SSE4", "AVX2", "AVX3"

// Floating-point operations per second of multiply-adds on registers alone (2 operations each), all threads together.
double peakFlops(ThreadPool& pool);
// 8-byte loads per second at random places of tables of `bytes` bytes, with indices streamed from memory, all threads
// together.
double gatherRate(ThreadPool& pool, size_t bytes, int tables);
// Bytes per second, read + written, of copies from one half of a buffer of `bytes` bytes to the other, all threads
// together.
double streamRate(ThreadPool& pool, size_t bytes);

}  // namespace tessera::cpu
