import { Button, Group, TextInput } from "@mantine/core";
import type { ReactNode } from "react";
import { useLoggedVehicles } from "../../api/logAnalyses";
import { ErrorNotice } from "../../ui/Notices";

interface Props {
  label: string;
  name: string;
  /** Whether the name is certain, so that nobody is asked for it. */
  isFixed?: boolean;
  submit: string;
  mutation: { error: unknown; isPending: boolean };
  onSubmit: (name: string, entered: FormData) => void;
  /** Beside the button. */
  children?: ReactNode;
}

/** Asks for the name of a vehicle whose logs are kept. */
export function NameForm({ label, name, isFixed = false, submit, mutation, onSubmit, children }: Props) {
  const known = useLoggedVehicles().data ?? [];
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        const entered = new FormData(event.currentTarget);
        onSubmit(isFixed ? name : String(entered.get("name")), entered);
      }}
    >
      <Group align="end" gap="12px 18px">
        {!isFixed && (
          <TextInput
            required
            withAsterisk={false}
            name="name"
            label={label}
            defaultValue={name}
            w={340}
            maw="100%"
            maxLength={120}
            list="logged-vehicles"
            autoComplete="off"
          />
        )}
        <datalist id="logged-vehicles">
          {known.map((vehicle) => (
            <option key={vehicle.id} value={vehicle.name} />
          ))}
        </datalist>
        <Button type="submit" loading={mutation.isPending}>
          {submit}
        </Button>
        {children}
      </Group>
      <ErrorNotice error={mutation.error} />
    </form>
  );
}
