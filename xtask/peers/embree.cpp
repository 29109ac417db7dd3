// Rays by Embree, one at a time on one thread, watertight: the triangles, then sets of rays (origin, direction, length).
//
// "closest-hit SET N" and "occlusion SET N" trace a set N times; the checksum is the number of hits.

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#include <cstring>

#include "peer.hpp"

static RTCRay to_ray(const float* r) {
    RTCRay ray{};
    ray.org_x = r[0]; ray.org_y = r[1]; ray.org_z = r[2];
    ray.dir_x = r[3]; ray.dir_y = r[4]; ray.dir_z = r[5];
    ray.tfar = r[6];
    ray.mask = -1;
    return ray;
}

int main(int, char** argv) {
    const std::vector<Array> arrays = read_arrays(argv[1]);
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const std::size_t corners = arrays[0].size() / 3;
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
        mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, corners));
    std::memcpy(vertices, arrays[0].data(), 12 * corners);
    auto* indices = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
        mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, corners / 3));
    for (std::uint32_t i = 0; i < corners; ++i) indices[i] = i;
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcCommitScene(scene);

#if RTC_VERSION_MAJOR < 4
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
#endif
    char what[16];
    unsigned set;
    unsigned long long n;
    while (std::scanf("%15s %u %llu", what, &set, &n) == 3) {
        const Array& rays = arrays[1 + set];
        const bool closest = std::strcmp(what, "closest-hit") == 0;
        answer(n, [&] {
            std::size_t hits = 0;
            for (std::size_t i = 0; i + 7 <= rays.size(); i += 7) {
                if (closest) {
                    RTCRayHit hit{to_ray(&rays[i]), {}};
                    hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
#if RTC_VERSION_MAJOR < 4
                    rtcIntersect1(scene, &context, &hit);
#else
                    rtcIntersect1(scene, &hit);
#endif
                    hits += hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
                } else {
                    RTCRay ray = to_ray(&rays[i]);
#if RTC_VERSION_MAJOR < 4
                    rtcOccluded1(scene, &context, &ray);
#else
                    rtcOccluded1(scene, &ray);
#endif
                    hits += ray.tfar < 0;
                }
            }
            return static_cast<double>(hits);
        });
    }
}
