/* Everything of libkarst's public interface. */
#ifndef KARST_H
#define KARST_H
#include "karst/aov.h"
#include "karst/camera.h"
#include "karst/change.h"
#include "karst/data.h"
#include "karst/display.h"
#include "karst/driver.h"
#include "karst/edit.h"
#include "karst/engine.h"
#include "karst/error.h"
#include "karst/helper.h"
#include "karst/image.h"
#include "karst/log.h"
#include "karst/measure.h"
#include "karst/path.h"
#include "karst/position.h"
#include "karst/reference.h"
#include "karst/saved.h"
#include "karst/stats.h"
#include "karst/view.h"
#include "karst/world.h"
#endif
