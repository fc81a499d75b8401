# Karst. `make help` lists the targets; V=1 shows commands; CONFIG=release|debug|asan chooses flags.
CONFIG  ?= release
BUILD   ?= build
OBJ     := $(BUILD)/$(CONFIG)
PREFIX  ?= /usr/local
DESTDIR ?=
CC      ?= cc
AR      ?= ar
# Folders that make the library, lowest floor first. Fewer may be named to build a part while working on it.
MODULES ?= core noise producers cache raycast
V ?= 0
ifeq ($(V),1)
Q :=
say = @:
else
Q := @
say = @printf '  %-6s %s\n'
endif

WARN   := -Wall -Wextra -Wstrict-prototypes -Wmissing-prototypes -Wshadow -Wpointer-arith -Wwrite-strings -Wvla
PKGS   := libpng jansson
CFLAGS_release := -O2 -g
CFLAGS_debug   := -O0 -g
CFLAGS_asan    := -O1 -g -fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer
LDFLAGS_asan   := -fsanitize=address,undefined
# -ffp-contract=off: host and device must agree bit for bit.
KCFLAGS := -std=c11 -D_GNU_SOURCE -ffp-contract=off -fPIC -pthread $(WARN) $(CFLAGS_$(CONFIG)) -I. -Icore/include $(shell pkg-config --cflags $(PKGS) 2>/dev/null) $(CFLAGS)
KLDFLAGS := $(LDFLAGS_$(CONFIG)) $(LDFLAGS)
KLIBS := $(shell pkg-config --libs $(PKGS) 2>/dev/null) -lOpenCL -ldl -lm -pthread

SOURCES := $(sort $(shell find $(MODULES) -name '*.c'))
OBJECTS := $(SOURCES:%.c=$(OBJ)/%.o) $(OBJ)/embedded_kernels.o
# Everything that a kernel may include travels inside the library.
KERNELS := $(sort $(shell find $(MODULES) -name '*.cl' -o -name '*.clh' -o -name '*_shared.h')) core/dialect.h
TESTS   := $(sort $(shell find tests -name 'test_*.c' 2>/dev/null))
TEST_PROGRAMS := $(TESTS:%.c=$(OBJ)/%)

.DEFAULT_GOAL := all
all: $(BUILD)/libkarst.a

$(BUILD)/libkarst.a: $(OBJECTS)
	$(say) AR $@
	$(Q)rm -f $@ && $(AR) rcs $@ $^

$(OBJ)/%.o: %.c
	$(say) CC $<
	$(Q)mkdir -p $(@D) && $(CC) $(KCFLAGS) -MMD -MP -c $< -o $@

$(OBJ)/embedded_kernels.c: core/embed.sh $(KERNELS)
	$(say) EMBED $@
	$(Q)mkdir -p $(@D) && sh core/embed.sh $(KERNELS) > $@.tmp && mv $@.tmp $@
$(OBJ)/embedded_kernels.o: $(OBJ)/embedded_kernels.c
	$(Q)$(CC) $(KCFLAGS) -c $< -o $@

$(OBJ)/tests/%: tests/%.c $(BUILD)/libkarst.a
	$(say) LD $@
	$(Q)mkdir -p $(@D) && $(CC) $(KCFLAGS) -MMD -MP $< $(BUILD)/libkarst.a $(KLDFLAGS) -lcmocka $(KLIBS) -o $@

clean:
	rm -rf $(BUILD)

.PHONY: all clean
.SECONDARY:
-include $(OBJECTS:.o=.d) $(TEST_PROGRAMS:%=%.d)
