/* Sizes of the measuring kernels. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_CORE_ENGINE_MEASURE_SHARED_H
#define KARST_CORE_ENGINE_MEASURE_SHARED_H

#define KARST_MEASURE_OCTAVES 8
#define KARST_MEASURE_FMA_CHAINS 10 /* independent ones in a work-item: enough to hide the latency of one */
#define KARST_MEASURE_FMA_STEPS 20000
#define KARST_MEASURE_COPY_CHUNK 4096 /* vectors of 4 floats that a CPU's work-item copies in a row */

#endif
