// A sketch for an Uno run in simavr, with a script of what comes to its pins and its serial port: uno_bench ELF SCRIPT MS
//
// A line of SCRIPT is a time [us], a letter and a number: "s" is a byte that begins to come by the serial port, "a" and
// "b" are the levels of pins 2 and 3. The times of UART bytes are at least as far apart as their bits take. The output
// has a line for each line that the sketch sends, "time L text", and for each change of the motor's pins, "time M drive":
// the duty of pin 9 (0 to 255) with the sign of pins 7 and 8; "M x" if both of these are on.

#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <stdlib.h>

enum { CYCLES_PER_US = 16, MOST = 100000, PORTB = 0x25, PORTD = 0x2B, TCCR1A = 0x80, OCR1A = 0x88 };

static avr_t *uno;
static char text[256];
static int length;

static unsigned long now(void) { return uno->cycle / CYCLES_PER_US; }

static void heard(struct avr_irq_t *irq, uint32_t byte, void *none) {
  if (byte == '\n') {
    printf("%lu L %.*s\n", now(), length, text);
    length = 0;
  } else if (length < 255) {
    text[length++] = byte;
  }
}

static void pin(int number, int level) {
  static avr_ioport_external_t outside = {.name = 'D', .mask = 0x0C, .value = 0x0C};
  outside.value = (outside.value & ~(1 << number)) | level << number;
  avr_ioctl(uno, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &outside);  // else a write to the port lets go of its inputs
  avr_raise_irq(avr_io_getirq(uno, AVR_IOCTL_IOPORT_GETIRQ('D'), number), level);
}

static int duty(void) {
  const uint8_t *at = uno->data;
  return at[TCCR1A] & 0x80 ? at[OCR1A] : at[PORTB] & 2 ? 255 : 0;
}

int main(int count, char **words) {
  static unsigned long times[MOST];
  static char kinds[MOST];
  static int values[MOST];
  int known = 0, next = 0, before = 0;
  elf_firmware_t firmware = {0};
  if (count != 4 || elf_read_firmware(words[1], &firmware)) return 2;
  FILE *file = fopen(words[2], "r");
  while (file && known < MOST && fscanf(file, "%lu %c %d", &times[known], &kinds[known], &values[known]) == 3) known++;
  if (!(uno = avr_make_mcu_by_name("atmega328p"))) return 2;
  avr_init(uno);
  avr_load_firmware(uno, &firmware);
  uno->frequency = 16000000;
  uint32_t flags = 0;
  avr_ioctl(uno, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
  avr_irq_register_notify(avr_io_getirq(uno, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), heard, NULL);
  avr_irq_t *serial = avr_io_getirq(uno, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
  while (now() < 1000ul * atol(words[3])) {
    if (avr_run(uno) >= cpu_Done) return 1;
    for (; next < known && times[next] <= now(); next++) {
      if (kinds[next] == 's')
        avr_raise_irq(serial, values[next]);
      else
        pin(kinds[next] == 'a' ? 2 : 3, values[next]);
    }
    int plus = uno->data[PORTD] >> 7 & 1, minus = uno->data[PORTB] & 1;
    int drive = plus && minus ? 999 : plus ? duty() : minus ? -duty() : 0;
    if (drive != before) printf(drive == 999 ? "%lu M x\n" : "%lu M %d\n", now(), before = drive);
  }
  return 0;
}
