// Reads a .nvdb file with NanoVDB's own headers, and says what they find. tests/cli/voxels.sh runs it.
//   nanovdb_check FILE                       each grid: number, name, class, active voxels, box, voxel, valid or why not
//   nanovdb_check FILE NAME points N         N active voxels all over: x,y,z in metres, and the exact value
//   nanovdb_check FILE NAME ball X,Y,Z,R     of a level set: how far it is from that of a ball, in voxels, at most
//   nanovdb_check FILE NAME copy OUT         the same grid, written by those headers and compressed with zlib
#include <iostream> // NanoVDB's headers forget it

#define NANOVDB_USE_ZIP
#include <nanovdb/NanoVDB.h>
#include <nanovdb/util/GridValidator.h>
#include <nanovdb/util/IO.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

using Grid = nanovdb::NanoGrid<float>;

static int tell(const char *path)
{
    const auto records = nanovdb::io::readGridMetaData(path);
    for (size_t i = 0; i < records.size(); i++) {
        auto handle = nanovdb::io::readGrid(path, i);
        const Grid *grid = handle.grid<float>();
        if (!grid)
            return std::printf("%zu is no grid of floats\n", i), 1;
        const std::string why = nanovdb::GridValidator<float>::check(*grid, true);
        const auto box = grid->tree().bbox();
        std::printf("%zu %s %s %llu [%d %d %d %d %d %d] %g %s\n", i, grid->gridName(), nanovdb::toStr(grid->gridClass()),
                    (unsigned long long)grid->activeVoxelCount(), box.min()[0], box.min()[1], box.min()[2],
                    box.max()[0], box.max()[1], box.max()[2], grid->voxelSize()[0], why.empty() ? "valid" : why.c_str());
        // what the file says of a grid, and what is in it
        unsigned long long active = 0;
        for (uint32_t n = 0; n < grid->tree().nodeCount(0); n++)
            for (auto it = grid->tree().getFirstLeaf()[n].beginValueOn(); it; ++it)
                active++;
        if (active != grid->activeVoxelCount() || records[i].voxelCount != active || records[i].gridSize != handle.size())
            return std::printf("its record is wrong: %llu active voxels\n", active), 1;
    }
    return records.empty();
}

static void points(const Grid &grid, unsigned long long wanted)
{
    const unsigned long long step = grid.activeVoxelCount() / wanted + 1;
    unsigned long long i = 0;
    auto reader = grid.getAccessor();
    for (uint32_t n = 0; n < grid.tree().nodeCount(0); n++)
        for (auto it = grid.tree().getFirstLeaf()[n].beginValueOn(); it; ++it)
            if (i++ % step == 0) {
                const auto at = it.getCoord();
                const auto place = grid.indexToWorld(nanovdb::Vec3d(at[0], at[1], at[2]));
                std::printf("%.17g,%.17g,%.17g %a\n", place[0], place[1], place[2], double(reader.getValue(at)));
            }
}

static int ball(const Grid &grid, const char *text)
{
    double x, y, z, radius, worst = 0;
    if (std::sscanf(text, "%lf,%lf,%lf,%lf", &x, &y, &z, &radius) != 4)
        return 1;
    const double voxel = grid.voxelSize()[0], band = grid.tree().background();
    const auto box = grid.tree().bbox();
    auto reader = grid.getAccessor();
    unsigned long long wrong = 0, num = 0;
    for (int i = box.min()[0] - 5; i <= box.max()[0] + 5; i++)
        for (int j = box.min()[1] - 5; j <= box.max()[1] + 5; j++)
            for (int k = box.min()[2] - 5; k <= box.max()[2] + 5; k++) {
                const nanovdb::Coord at(i, j, k);
                const auto place = grid.indexToWorld(nanovdb::Vec3d(i, j, k));
                const double true_m = std::hypot(std::hypot(place[0] - x, place[1] - y), place[2] - z) - radius;
                const double value = reader.getValue(at);
                const bool is_near = std::fabs(true_m) < band - 0.1 * voxel, is_far = std::fabs(true_m) > band + 0.1 * voxel;
                num += reader.isActive(at);
                if (reader.isActive(at))
                    worst = std::fmax(worst, std::fabs(value - true_m) / voxel);
                wrong += (value < 0) != (true_m < 0) || (is_near && !reader.isActive(at)) ||
                         (is_far && (reader.isActive(at) || std::fabs(value) != band));
            }
    std::printf("%llu active, %llu wrong, at most %.6f voxels off\n", num, wrong, worst);
    return wrong > 0;
}

int main(int argc, char **argv)
try {
    if (argc == 2)
        return tell(argv[1]);
    if (argc != 5)
        return 2;
    auto handle = nanovdb::io::readGrid(argv[1], std::string(argv[2]));
    const Grid *grid = handle.grid<float>();
    if (!grid)
        return std::printf("no grid of floats is called %s\n", argv[2]), 1;
    if (!std::strcmp(argv[3], "points"))
        return points(*grid, std::strtoull(argv[4], nullptr, 10)), 0;
    if (!std::strcmp(argv[3], "copy"))
        return nanovdb::io::writeGrid(argv[4], handle, nanovdb::io::Codec::ZIP), 0;
    return !std::strcmp(argv[3], "ball") ? ball(*grid, argv[4]) : 2;
} catch (const std::exception &error) {
    std::printf("%s\n", error.what());
    return 1;
}
