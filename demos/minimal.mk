# Builds minimal.c against an installed libkarst, wherever pkg-config finds it.
minimal: minimal.c
	$(CC) -std=c11 -O2 $(CFLAGS) $(shell pkg-config --cflags karst) $< $(LDFLAGS) $(shell pkg-config --libs karst) -o $@
