/* A phone that is turned about its long axis, sample by sample: attitude, standard deviations, NIS.
 *
 *   cc -I include examples/attitude.c libnorthing_c.a -lm && ./a.out
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>

#include "northing.h"

int main(void) {
    static northing_mekf filter; /* zeros: no filter yet */
    const northing_setting settings[] = {{"accelerometer_std", {(northing_real)0.1, 0, 0}}};
    if (northing_mekf_init(&filter, NORTHING_PROFILE_LAB, settings, 1) != NORTHING_STATUS_OK) {
        return 1;
    }
    northing_innovation told = {0};
    northing_real angle = 0;
    for (int64_t k = 0; k < 1000; k++) {
        const northing_real rate = (northing_real)(0.5 * sin(0.01 * (double)k));
        angle += rate * (northing_real)0.01;
        const northing_real w[3] = {rate, 0, 0};
        const northing_real f[3] = {0, (northing_real)(9.81 * sin((double)angle)), (northing_real)(9.81 * cos((double)angle))};
        northing_mekf_gyroscope(&filter, k * 10000000, w);
        told = northing_mekf_accelerometer(&filter, k * 10000000, f);
    }
    northing_real q[4], covariance[9];
    if (northing_mekf_quat(&filter, q) != NORTHING_STATUS_OK ||
        northing_mekf_covariance(&filter, covariance) != NORTHING_STATUS_OK) {
        return 1;
    }
    const double roll = 2.0 * atan2((double)q[1], (double)q[0]);
    printf("roll %.2f deg, in truth %.2f; standard deviation %.2f deg; NIS %.2f of %d\n", roll * 57.29578,
           (double)angle * 57.29578, sqrt((double)covariance[0]) * 57.29578, (double)told.nis, told.degrees_of_freedom);
    return fabs(roll - (double)angle) < 0.02 && told.outcome == NORTHING_OUTCOME_FUSED ? 0 : 1;
}
