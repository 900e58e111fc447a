import { SimpleGrid, TextInput, type TextInputProps } from "@mantine/core";
import type { GetInputPropsReturnType } from "@mantine/form";
import type { Catalogue } from "../../api/types";
import { OptionField } from "../../ui/Fields";
import { FoldedSection } from "../../ui/FormPage";
import { furtherOptions } from "./fleet";

export const PLAIN_LABELS = { name: "Name", "options.address": "Address" };

export function NameField(props: TextInputProps) {
  return (
    <TextInput
      label={PLAIN_LABELS.name}
      description="Shown on every page, for example the number on the airframe"
      maxLength={120}
      {...props}
    />
  );
}

export function AddressField(props: TextInputProps) {
  return (
    <TextInput
      label={PLAIN_LABELS["options.address"]}
      description="udp:HOST:PORT@LOCALPORT (the vehicle sends to LOCALPORT of this computer), udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"
      inputWrapperOrder={["label", "input", "description", "error"]}
      autoCapitalize="off"
      spellCheck={false}
      {...props}
    />
  );
}

interface FurtherProps {
  catalogue: Catalogue;
  autopilot: string;
  /** Props of an option's input, by the option's name. */
  input: (name: string) => GetInputPropsReturnType;
}

/** The options that have defaults, collapsed unless one of them is refused. */
export function FurtherFields({ catalogue, autopilot, input }: FurtherProps) {
  const options = furtherOptions(catalogue, autopilot);
  return (
    <FoldedSection
      title="Advanced: identity, limits, motion capture, signing"
      forcedOpen={options.some(({ name }) => input(name).error !== undefined)}
    >
      <SimpleGrid minColWidth={260} autoFlow="auto-fit" spacing={16}>
        {options.map((option) => (
          <OptionField key={option.name} option={option} {...input(option.name)} />
        ))}
      </SimpleGrid>
    </FoldedSection>
  );
}

/** Titles of these options by field. */
export function furtherLabels(catalogue: Catalogue): Record<string, string> {
  return Object.fromEntries(
    furtherOptions(catalogue).map(({ name, title, label }) => [`options.${name}`, label || title]),
  );
}
