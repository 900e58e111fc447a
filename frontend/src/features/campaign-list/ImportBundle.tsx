import { Button, FileButton } from "@mantine/core";
import { useImportBundle } from "../../api/files";
import { ErrorNotice } from "../../ui/Notices";

/** Import of a campaign bundle from another installation. */
export function ImportBundle() {
  const imported = useImportBundle();
  return (
    <div>
      <FileButton accept=".zip" onChange={(file) => file && imported.mutate(file)}>
        {(props) => (
          <Button {...props} variant="default" loading={imported.isPending}>
            Import bundle
          </Button>
        )}
      </FileButton>
      <ErrorNotice error={imported.error} />
    </div>
  );
}
