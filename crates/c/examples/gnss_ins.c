/* A car that stands, drives off and turns: inertial unit at 100 Hz, fixes and their velocities at 1 Hz.
 *
 *   cc -I include examples/gnss_ins.c libnorthing_c.a -lm && ./a.out
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>

#include "northing.h"

int main(void) {
    static northing_gnss_ins ins;
    const northing_setting settings[] = {{"lever_arm_m", {0, 0, -1}}};
    if (northing_gnss_ins_init(&ins, settings, 1) != NORTHING_STATUS_OK) {
        return 1;
    }
    double north = 0, east = 0, speed = 0, heading = 0;
    northing_innovation told = {0}, vertical = {0};
    const northing_real std[3] = {1, 1, 2}, velocity_std[3] = {(northing_real)0.1, (northing_real)0.1, (northing_real)0.2};
    for (int64_t k = 1; k <= 12000; k++) {
        const double t = 0.01 * (double)k;
        const double acceleration = t > 5 && t < 10 ? 2.0 : (t > 60 && t < 64 ? -1.0 : 0.0);
        const double turn = t > 15 ? 0.1 * sin(0.1 * t) : 0.0;
        speed += acceleration * 0.01;
        heading += turn * 0.01;
        north += speed * cos(heading) * 0.01;
        east += speed * sin(heading) * 0.01;
        const northing_real rate[3] = {0, 0, (northing_real)turn};
        const northing_real force[3] = {(northing_real)acceleration, (northing_real)(speed * turn), (northing_real)-9.80665};
        northing_gnss_ins_imu(&ins, k * 10000000, rate, force);
        if (k % 100 == 0) {
            /* the antenna is a metre above the unit */
            const northing_real fix[3] = {(northing_real)(north + 0.3 * sin(7 * t)), (northing_real)(east + 0.3 * cos(5 * t)), -1};
            const northing_real over_ground[3] = {(northing_real)(speed * cos(heading)), (northing_real)(speed * sin(heading)), 0};
            told = northing_gnss_ins_position(&ins, k * 10000000, fix, std, &vertical);
            northing_gnss_ins_velocity(&ins, k * 10000000, over_ground, velocity_std);
        }
    }
    northing_real position[3], position_std[3], velocity[3];
    if (northing_gnss_ins_solution(&ins, position, position_std, velocity, NULL) != NORTHING_STATUS_OK) {
        return 1;
    }
    printf("north %.1f m, east %.1f m, in truth %.1f and %.1f; standard deviation %.1f m; status %d; NIS %.2f of %d\n",
           (double)position[0], (double)position[1], north, east, (double)position_std[0],
           (int)northing_gnss_ins_solution_status(&ins), (double)told.nis, told.degrees_of_freedom);
    const double off = hypot((double)position[0] - north, (double)position[1] - east);
    return off < 2.0 && northing_gnss_ins_solution_status(&ins) == NORTHING_SOLUTION_STATUS_AIDED ? 0 : 1;
}
