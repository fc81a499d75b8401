/* Bricks of a medium: what fills the space outside matter. See producers/steps/medium.clh. */
#ifndef KARST_PRODUCERS_MEDIUM_H
#define KARST_PRODUCERS_MEDIUM_H

/* With this option all kernels of a density program are built whose density is a medium's extinction
 * (karst_world_build: in both its options). Its nodes are air where the extinction is proved to be at most 0, clear air
 * where no sample of their level has any, and else bricks, wherever the medium is: nothing is solid. Samples are means
 * (medium.clh), and not below 0. Of a brick's masks a bit is set where a cell has a sample above 0.
 * karst_scrub_total.raised counts what was below 0. */
#define KARST_MEDIUM_OPTION "-DKARST_MEDIUM"

#endif
